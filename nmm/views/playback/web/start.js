// Where the commands come from: the page itself, or the server that sent it.
"use strict";
{
  const status = document.getElementById("status");
  const embedded = document.getElementById("commands");
  // Not before all parts of the page are there.
  window.addEventListener("resize", () => nmm.resize());

  // A program that has ended hears nothing: what one would tell it by looks dead, and is.
  function end() {
    nmm.ended = true;
    document.body.classList.add("ended");
    for (const id of ["drive", "panel", "all"]) document.getElementById(id)?.setAttribute("inert", "");
    for (const ending of nmm.endings) ending();
    nmm.viewer.set_dirty();
  }

  function listen() {
    const socket = new WebSocket(`ws://${location.host}/socket?token=${document.body.dataset.token}`);
    // Says whether there is somebody who hears it.
    nmm.send = (message) => {
      const open = socket.readyState === WebSocket.OPEN;
      if (open) socket.send(JSON.stringify(message));
      return open;
    };
    socket.onmessage = (message) => {
      for (const line of message.data.split("\n")) nmm.execute(nmm.decode(line));
      nmm.viewer.num_messages_received++;
    };
    socket.onclose = () => {
      if (nmm.stage && !nmm.stage.live) return;
      status.textContent = "The program that showed this has ended.";
      status.classList.add("bad");
      end();
    };
  }

  try {
    if (document.body.dataset.source === "socket") listen();
    else for (const line of embedded.textContent.trim().split("\n")) nmm.execute(nmm.decode(line));
  } catch (error) {
    status.textContent = `This page cannot be shown: ${error.message}`;
    status.classList.add("bad");
    throw error;
  }
}
