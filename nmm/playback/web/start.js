// Where the commands come from: the page itself, or the server that sent it.
"use strict";
{
  const status = document.getElementById("status");
  const embedded = document.getElementById("commands");

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
      status.textContent = nmm.stage && !nmm.stage.live ? "" : "The program that showed this has ended.";
      status.classList.toggle("bad", status.textContent !== "");
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
