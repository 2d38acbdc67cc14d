// The page as a film: no controls, and the time in a corner. And one picture of what is on the screen, at twice
// its size.
"use strict";
{
  nmm.film = ({ view, follow, plots, apart }) => {
    document.body.classList.add("film");
    nmm.plots.show(plots);
    if (apart > 0 && nmm.motions.length > 1) nmm.apart.set(apart);
    nmm.camera.look(view);
    if (follow !== nmm.camera.following) nmm.actions.follow();
    nmm.resize();
  };
  nmm.filmed = (t) => {
    nmm.seek(t);
    document.getElementById("status").textContent = `t = ${t.toFixed(2)} s`;
    nmm.viewer.render(); // now, not with the next frame: whoever takes the picture need not wait for two
  };

  // The scene as PNG, `times` as large as on the screen.
  nmm.picture = (times = 2) => {
    const { renderer, scene, camera } = nmm.viewer;
    const usual = renderer.getPixelRatio();
    renderer.setPixelRatio(usual * times);
    nmm.viewer.set_3d_pane_size();
    renderer.render(scene, camera);
    const picture = renderer.domElement.toDataURL("image/png");
    renderer.setPixelRatio(usual);
    nmm.viewer.set_3d_pane_size();
    nmm.viewer.set_dirty();
    return picture;
  };
  // A file of what is here at this time.
  nmm.save = (address, kind) => {
    const name = document.title.toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "") || "scene";
    const link = document.createElement("a");
    link.download = `${name}-${(nmm.stage.start + nmm.player.time).toFixed(2)}s.${kind}`;
    link.href = address;
    link.click();
  };
  document.getElementById("picture").addEventListener("click", () => nmm.save(nmm.picture(), "png"));
}
