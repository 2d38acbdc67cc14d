"""Pages of a program without a browser: they connect as a browser's do, and keep what they are told."""

from __future__ import annotations

import asyncio
import base64
import json
import re
import socket
import threading
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Any

import numpy as np
from ports import MOST, listening, wait_for
from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, WebSocketClosedError, websocket_connect

import nmm
from nmm.motion.trajectory import Trajectory
from nmm.views.playback import LiveRun

#: The arrays of a page's commands.
KINDS = {"f32": "<f4", "f64": "<f8", "u32": "<u4"}


def token_of(url: str) -> str:
    with urllib.request.urlopen(url, timeout=MOST) as answer:
        found = re.search(r'data-token="([^"]+)"', answer.read().decode())
    assert found is not None
    return found[1]


def unpacked(value: dict[str, str]) -> np.ndarray:
    """An array of a command."""
    ((kind, text),) = value.items()
    return np.frombuffer(base64.b64decode(text), KINDS[kind])


class LivePage:
    """A page in a thread of its own, which answers each picture as one that draws it, or never.

    Attributes
    ----------
    told : the commands that it got, without those of the scene
    closed : whether the program has hung up
    """

    def __init__(self, url: str, *, answers: bool = True) -> None:
        self.told: list[dict[str, Any]] = []
        self.closed = False
        self.hello: list[str] = []
        self._answers, self._drawn = answers, 0
        self._socket: WebSocketClientConnection | None = None
        address = f"{url.replace('http', 'ws')}socket?token={token_of(url)}"
        self._request = HTTPRequest(address, headers={"Origin": url.strip("/")})
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        wait_for(lambda: bool(self.hello))

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._listen())
        self._loop.close()

    async def _listen(self) -> None:
        self._socket = await websocket_connect(self._request)
        while (message := await self._socket.read_message()) is not None:
            lines = str(message).splitlines()
            if not self.hello:
                self.hello = lines
                continue
            for line in lines:
                command = json.loads(line)
                self.told.append(command)
                if self._answers and "picture" in command:
                    self._drawn += 1
                    answer = {"type": "drawn", "picture": command["picture"], "drawn": self._drawn}
                    with suppress(WebSocketClosedError):  # hung up meanwhile: so says the next message
                        await self._socket.write_message(json.dumps(answer))
        self.closed = True

    def says(self, text: str) -> None:
        """Send a message."""

        def send() -> None:
            assert self._socket is not None
            self._socket.write_message(text)

        self._loop.call_soon_threadsafe(send)

    def of(self, kind: str) -> list[dict[str, Any]]:
        """The commands of a type that it got."""
        return [command for command in tuple(self.told) if command["type"] == kind]

    def __enter__(self) -> LivePage:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if not self.closed:
            self._loop.call_soon_threadsafe(lambda: self._socket and self._socket.close())
        self._thread.join(timeout=MOST)
        assert not self._thread.is_alive()


def dead_page(url: str) -> socket.socket:
    """A page that connects and never reads."""
    address = url.removeprefix("http://").strip("/")
    host, port = address.split(":")
    page = socket.create_connection((host, int(port)), timeout=MOST)
    page.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    page.sendall(
        f"GET /socket?token={token_of(url)} HTTP/1.1\r\nHost: {address}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    assert b"101 Switching" in page.recv(100)
    return page


@contextmanager
def live(
    one: nmm.Scenario, controller: nmm.Controller | None = None
) -> Iterator[tuple[LiveRun, Callable[[], Trajectory]]]:
    """A page for a run, and what computes the run and shows it to its end in a thread."""
    controller = one.controller() if controller is None else controller
    parts, stop, threads = one.parts, threading.Event(), []
    with LiveRun(controller, parts.q0, parts.duration, open_browser=False) as page:

        def run() -> Trajectory:
            made = one.run(None, controller, page.watch)
            staying = threading.Thread(target=page.stay, args=(made,), kwargs={"stop": stop})
            threads.append(staying)
            staying.start()
            return made

        try:
            yield page, run
        finally:
            stop.set()
            for thread in threads:
                thread.join(timeout=MOST)
                assert not thread.is_alive()
    port = int(page.url.rsplit(":", 1)[1].strip("/"))
    assert port not in listening()
