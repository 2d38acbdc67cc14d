// The scene as a film, picture by picture at exact times: a slow machine needs longer and makes the same one.
"use strict";
{
  const FPS = 30;
  const CODECS = [["vp09.00.51.08", "V_VP9"], ["vp8", "V_VP8"]];
  const button = document.getElementById("film");
  const progress = button.querySelector("span");
  const status = document.getElementById("status");
  const even = (length) => Math.max(2, 2 * Math.round(length / 2));
  let stop = null;

  // Where the pictures are: the part of the time that is zoomed into, at the speed of the clock.
  nmm.filmTimes = () => {
    const { from, to } = nmm.player.range;
    const step = nmm.player.speed / FPS;
    return Array.from({ length: Math.floor((to - from) / step + 1e-9) + 1 }, (_, k) => from + k * step);
  };

  // The scene at a time, over the page's background, with the time in a corner.
  nmm.filmPicture = (pen, time) => {
    const { width, height } = pen.canvas;
    nmm.player.seek(time);
    nmm.viewer.render();
    const background = pen.createLinearGradient(0, 0, 0, height);
    background.addColorStop(0, nmm.theme.variable("--sky"));
    background.addColorStop(0.45, nmm.theme.variable("--floor"));
    pen.fillStyle = background;
    pen.fillRect(0, 0, width, height);
    pen.drawImage(nmm.viewer.renderer.domElement, 0, 0, width, height);
    Object.assign(pen, { font: `${Math.round(0.03 * height) + 8}px system-ui, sans-serif`, textBaseline: "bottom", textAlign: "right" });
    pen.fillStyle = nmm.theme.variable("--ink");
    pen.fillText(`t = ${(nmm.stage.start + time).toFixed(2)} s`, width - 14, height - 10);
  };

  nmm.filmPen = () => {
    const { width, height } = nmm.viewer.renderer.domElement;
    return Object.assign(document.createElement("canvas"), { width: even(width), height: even(height) }).getContext("2d");
  };

  async function chosen(size) {
    for (const [codec, name] of CODECS) {
      const wanted = { codec, ...size, framerate: FPS, bitrate: Math.round(Math.max(2e6, 0.15 * FPS * size.width * size.height)) };
      if ((await VideoEncoder.isConfigSupported(wanted)).supported) return [wanted, name];
    }
    throw new Error("this browser encodes neither VP9 nor VP8");
  }

  // A Blob; null when it was stopped. told(share): how much is done.
  nmm.record = async (told = () => {}, stopped = () => false) => {
    const pen = nmm.filmPen();
    const { width, height } = pen.canvas;
    const [config, codec] = await chosen({ width, height });
    const [pictures, times, was] = [[], nmm.filmTimes(), { time: nmm.player.time, playing: nmm.player.playing }];
    let failed = null;
    const encoder = new VideoEncoder({
      output: (chunk) => {
        const data = new Uint8Array(chunk.byteLength);
        chunk.copyTo(data);
        pictures.push({ data, time: Math.round(chunk.timestamp / 1000), key: chunk.type === "key" });
      },
      error: (error) => (failed = error),
    });
    encoder.configure(config);
    nmm.player.pause();
    try {
      for (let k = 0; k < times.length && !stopped(); k++) {
        nmm.filmPicture(pen, times[k]);
        const frame = new VideoFrame(pen.canvas, { timestamp: Math.round((1e6 * k) / FPS), duration: Math.round(1e6 / FPS) });
        encoder.encode(frame, { keyFrame: k % (2 * FPS) === 0 });
        frame.close();
        told(k / times.length);
        do await new Promise((next) => setTimeout(next));
        while (encoder.encodeQueueSize > 4 && failed === null);
        if (failed !== null) throw failed;
      }
      if (stopped()) return null;
      await encoder.flush();
      return nmm.webm({ codec, width, height, fps: FPS }, pictures);
    } finally {
      if (encoder.state !== "closed") encoder.close();
      nmm.player.seek(was.time);
      if (was.playing) nmm.player.play();
    }
  };

  button.addEventListener("click", async () => {
    if (nmm.stage.live) return;
    if (stop !== null) return stop();
    status.textContent = "";
    if (!window.VideoEncoder) {
      status.textContent = "This browser cannot write films. nmm render RUN --video film.webm can.";
      return;
    }
    let ended = false;
    stop = () => (ended = true);
    button.setAttribute("aria-pressed", "true");
    const title = button.title;
    button.title = "Stop (W)";
    try {
      const film = await nmm.record((share) => (progress.textContent = `${Math.floor(100 * share)} %`), () => ended);
      if (film !== null) nmm.save(URL.createObjectURL(film), "webm");
    } catch (error) {
      status.textContent = `No film could be written: ${error.message}`;
    } finally {
      stop = null;
      button.removeAttribute("aria-pressed");
      button.title = title;
      progress.textContent = "";
    }
  });
}
