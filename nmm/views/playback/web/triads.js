// The axes of frames, x, y and z in red, green and blue: of a robot's links that move, and of its tools.
"use strict";
{
  const THREE = MeshCat.THREE;
  const COLORS = [[0.84, 0.2, 0.18], [0.16, 0.6, 0.24], [0.16, 0.38, 0.86]];
  const button = document.getElementById("axes");
  const robots = []; // {frames: [{path, name, named}], make, groups}

  // What makes triads of a length, m: solid where one sees them, faint where something is before them.
  nmm.triad = (length) => {
    const shaft = new THREE.CylinderGeometry(0.035 * length, 0.035 * length, length, 10);
    shaft.translate(0, 0.5 * length, 0);
    const parts = COLORS.map((rgb, axis) => {
      const along = shaft.clone();
      if (axis === 0) along.rotateZ(-Math.PI / 2);
      if (axis === 2) along.rotateX(Math.PI / 2);
      const color = nmm.color(rgb);
      const faint = { color, transparent: true, opacity: 0.4, depthTest: false, depthWrite: false };
      return [along, new THREE.MeshBasicMaterial({ color }), new THREE.MeshBasicMaterial(faint)];
    });
    return () => {
      const group = new THREE.Group();
      for (const [geometry, solid, faint] of parts) {
        const before = new THREE.Mesh(geometry, faint);
        before.renderOrder = 900;
        group.add(new THREE.Mesh(geometry, solid), before);
      }
      return group;
    };
  };

  nmm.hooks.triads = ({ frames, length }) => {
    document.body.classList.add("framed");
    robots.push({ frames, length, make: nmm.triad(length), groups: null });
  };

  // The root's name and the tools' stand beside them; of several robots, those of the first.
  function named(group, name, length) {
    const tag = nmm.texts.put(nmm.scenery.label(name, () => (nmm.theme.dark ? [0.9, 0.93, 0.96] : [0.2, 0.26, 0.33]), false, 0.75), "frame");
    tag.position.set(0, 0, 1.25 * length);
    group.add(tag);
  }

  nmm.actions.axes = () => {
    const on = button.getAttribute("aria-pressed") !== "true";
    for (const robot of robots) {
      robot.groups ??= robot.frames.map(({ path, name, named: told }) => {
        const group = robot.make();
        if (told && robot === robots[0]) named(group, name, robot.length);
        nmm.node(path).add(group);
        return group;
      });
      for (const group of robot.groups) group.visible = on;
    }
    button.setAttribute("aria-pressed", String(on));
    nmm.viewer.set_dirty();
    nmm.address.changed();
  };
  button.addEventListener("click", nmm.actions.axes);
}
