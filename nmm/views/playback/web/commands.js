// What the page is told to draw. Commands come as lines of JSON, from the page itself or from a socket, and
// are carried out in order and at once; those not known here are MeshCat's.
"use strict";
const nmm = (window.nmm = { hooks: {}, geometries: {}, endings: [], ended: false, silent: false });

{
  const view = document.getElementById("view");
  const see = (drawn) => {
    document.body.classList.toggle("blind", !drawn);
    if (nmm.viewer) nmm.viewer.set_dirty();
  };

  // Without WebGL all goes on as it does, and nothing is drawn.
  function blind(domElement) {
    see(false);
    return { domElement, shadowMap: {}, render: () => {}, setSize: () => {}, setPixelRatio: () => {} };
  }
  // What MeshCat would make itself. But a browser draws only some 16 of these at a time, so none is made to ask.
  function drawing() {
    const canvas = Object.assign(document.createElement("canvas"), { style: "display: block" });
    const wanted = { alpha: true, depth: true, stencil: true, antialias: true };
    const context = canvas.getContext("webgl2", wanted) || canvas.getContext("webgl", wanted);
    if (context === null || context.isContextLost()) return blind(canvas);
    const renderer = new MeshCat.THREE.WebGLRenderer({ canvas, context, ...wanted });
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = MeshCat.THREE.PCFSoftShadowMap;
    view.appendChild(canvas);
    // The shaders are three.js's own. Asking after each costs time, and throws where the graphics are being reset.
    renderer.debug.checkShaderErrors = false;
    canvas.addEventListener("webglcontextlost", () => see(false));
    canvas.addEventListener("webglcontextrestored", () => see(true));
    return renderer;
  }
  nmm.viewer = window.viewer = new MeshCat.Viewer(view, true, drawing());

  // Nothing is drawn before all is there. The first picture leaves out the robots' copies: with OpenGL by the
  // processor they and their shaders take as long as all the rest.
  const { render } = nmm.viewer;
  let first = true;
  nmm.viewer.render = () => {
    if (document.body.classList.contains("loading")) return;
    const later = first ? (nmm.ghosts || []).filter(({ visible }) => visible) : [];
    first = false;
    for (const copies of later) copies.visible = false;
    render.call(nmm.viewer);
    for (const copies of later) copies.visible = true;
    if (later.length) nmm.viewer.set_dirty();
  };

  // MeshCat takes the window's height for the view's.
  const fit = nmm.viewer.set_3d_pane_size;
  nmm.viewer.set_3d_pane_size = () => {
    if (view.clientWidth && view.clientHeight) fit.call(nmm.viewer, view.clientWidth, view.clientHeight);
  };
  nmm.resize = () => {
    nmm.viewer.set_3d_pane_size();
    nmm.scenery.fit();
    nmm.texts.fit();
    if (nmm.stage) nmm.camera.fit();
    nmm.viewer.set_dirty();
  };
}

{
  const THREE = MeshCat.THREE;
  const ARRAYS = { f32: Float32Array, f64: Float64Array, u32: Uint32Array, u16: Uint16Array };

  nmm.split = (path) => path.split("/").filter((name) => name.length > 0);
  nmm.node = (path) => nmm.viewer.scene_tree.find(nmm.split(path)).object;
  nmm.color = (rgb) => new THREE.Color(...rgb).convertSRGBToLinear();

  nmm.decode = (line) =>
    JSON.parse(line, (_, value) => {
      if (value === null || typeof value !== "object") return value;
      const keys = Object.keys(value);
      const kind = keys.length === 1 ? ARRAYS[keys[0]] : undefined;
      if (kind === undefined) return value;
      const text = atob(value[keys[0]]);
      const bytes = new Uint8Array(text.length);
      for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
      return new kind(bytes.buffer);
    });

  nmm.execute = (command) => {
    const own = nmm.hooks[command.type];
    if (own === undefined) nmm.viewer.handle_command(command);
    else own(command);
    nmm.viewer.set_dirty();
  };

  nmm.hooks.geometry = ({ id, data }) => {
    const geometry = new THREE.ObjectLoader().parseGeometries([{ ...data, uuid: id }])[id];
    if (geometry.attributes.normal === undefined) geometry.computeVertexNormals();
    nmm.geometries[id] = geometry;
  };

  nmm.hooks.object = ({ path, geometry, material }) => {
    const shape = nmm.geometries[geometry];
    const mesh = new THREE.Mesh(
      shape,
      new THREE.MeshPhongMaterial({
        color: nmm.color(material.color),
        specular: 0x202020,
        shininess: 40,
        opacity: material.opacity,
        transparent: material.opacity < 1,
        depthWrite: !material.sheet,
        // Files of meshes do not always agree on which side is outside.
        side: shape.type === "BufferGeometry" ? THREE.DoubleSide : THREE.FrontSide,
        polygonOffset: material.rank > 0,
        polygonOffsetFactor: material.rank,
        polygonOffsetUnits: 2 * material.rank,
      }),
    );
    mesh.castShadow = mesh.receiveShadow = !material.sheet;
    nmm.viewer.set_object(nmm.split(path), mesh);
  };

  nmm.hooks.places = ({ transforms }) => {
    for (const [path, matrix] of transforms) nmm.viewer.set_transform(nmm.split(path), matrix);
  };

  nmm.hooks.pose = ({ transforms }) => {
    nmm.hooks.places({ transforms });
    nmm.viewer.scene.updateMatrixWorld();
    nmm.camera.update();
    const root = new THREE.Vector3().setFromMatrixPosition(nmm.node(nmm.motions[0].root).matrixWorld);
    nmm.scenery.center(root.x, -root.z);
  };
}
