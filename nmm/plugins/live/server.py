"""A web server on the loopback interface, in a thread of this process, with which it ends."""

from __future__ import annotations

import asyncio
import atexit
import secrets
import socket
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass

import tornado.web
import tornado.websocket
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets

from nmm.base.errors import InputError, RunError, expect

LOOPBACK = "127.0.0.1"
#: Tried in this order when no port is asked for; if all are taken, the system chooses.
PORTS = range(7000, 7020)
#: Pause between two poses sent to a page, s: no screen shows more.
PERIOD = 1.0 / 60.0
#: Longest message of a page, bytes; a longer one ends its connection.
LONGEST_MESSAGE = 4096


@dataclass(frozen=True)
class Visitor:
    """Callbacks of a connected page, in the server's thread: `latest` gives new lines, or ""; `heard` takes a
    message and tells whether there is something new; `gone` is called when the page has left."""

    latest: Callable[[], str]
    heard: Callable[[str | bytes], bool] = lambda message: False
    gone: Callable[[], None] = lambda: None


class PageServer:
    """Serves one page and sends it commands; `InputError` for a port taken, not allowed, or not a port.

    `page` makes it from the host ("127.0.0.1:port") and the token. A connected page gets the lines of
    `hello`, which may be replaced, then its visitor's `latest()` after each `changed()`: a slow page, or one
    in a background tab, misses what is old and delays no other. Only this server's pages can connect: they
    know the token and come from this address.
    """

    def __init__(
        self,
        page: Callable[[str, str], str],
        hello: Sequence[str],
        visit: Callable[[], Visitor] | None = None,
        *,
        port: int | None = None,
    ) -> None:
        self._socket = _listen(port)
        self.port = int(self._socket.getsockname()[1])
        self.host = f"{LOOPBACK}:{self.port}"
        self.url = f"http://{self.host}/"
        self.token = secrets.token_urlsafe(16)
        try:
            self.page = page(self.host, self.token).encode("utf-8")
        except BaseException:
            self._socket.close()
            raise
        self.hello = hello
        self.visit = visit
        self.pages: set[_Socket] = set()
        self._loop = asyncio.new_event_loop()
        self._notified = False
        self._closed = False
        self._started: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, name=f"nmm playback {self.port}", daemon=True)
        self._thread.start()
        self._started.result(timeout=10.0)
        atexit.register(self.close)

    def changed(self) -> None:
        """Announce news in `latest`, without waiting for a page; `RunError` once closed."""
        if self._closed:
            raise RunError("the viewer has been closed")
        if not self._notified:
            self._notified = True
            self._loop.call_soon_threadsafe(self._wake)

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        atexit.unregister(self.close)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(timeout=5.0)

    def _wake(self) -> None:
        self._notified = False
        for page in self.pages:
            page.news.set()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            application = tornado.web.Application(
                [("/", _Page, {"server": self}), ("/socket", _Socket, {"server": self})],
                log_function=lambda handler: None,
                websocket_max_message_size=LONGEST_MESSAGE,
            )
            http = HTTPServer(application)
            http.add_sockets([self._socket])
        except Exception as error:
            self._started.set_exception(error)
            raise
        self._started.set_result(None)
        try:
            self._loop.run_forever()
        finally:
            http.stop()
            self._loop.run_until_complete(self._hang_up(http))
            self._loop.close()

    async def _hang_up(self, http: HTTPServer) -> None:
        for page in tuple(self.pages):
            page.close()
        # At most a second for a page that does not answer.
        await asyncio.wait([asyncio.ensure_future(http.close_all_connections())], timeout=1.0)
        waiting = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)


class _Local(tornado.web.RequestHandler):
    """Answers requests for this address only, not for a foreign name that resolves to 127.0.0.1."""

    def initialize(self, server: PageServer) -> None:
        self.server = server

    def prepare(self) -> None:
        if self.request.host not in (self.server.host, f"localhost:{self.server.port}"):
            raise tornado.web.HTTPError(403)


class _Page(_Local):
    def get(self) -> None:
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.finish(self.server.page)


class _Socket(tornado.websocket.WebSocketHandler, _Local):
    def prepare(self) -> None:
        super().prepare()
        known = self.get_query_argument("token", "").encode()
        if not secrets.compare_digest(known, self.server.token.encode()):
            raise tornado.web.HTTPError(403)

    def open(self, *args: str, **kwargs: str) -> None:
        visit = self.server.visit
        self.visitor = None if visit is None else visit()
        self.news = asyncio.Event()
        self.news.set()
        self.server.pages.add(self)
        # Its own task: Tornado notices that a page is gone only after this method has returned.
        self._sending = asyncio.ensure_future(self._send())

    async def _send(self) -> None:
        server, visitor = self.server, self.visitor
        try:
            await self.write_message("\n".join(server.hello))
            while visitor is not None:
                await self.news.wait()
                self.news.clear()
                line = visitor.latest()
                if line:
                    await self.write_message(line)
                await asyncio.sleep(PERIOD)
        except tornado.websocket.WebSocketClosedError:
            server.pages.discard(self)
        except Exception:  # a page without pictures says that its program has ended
            server.pages.discard(self)
            self.close()
            raise

    def on_message(self, message: str | bytes) -> None:
        if self.visitor is not None and self.visitor.heard(message):
            self.news.set()

    def on_close(self) -> None:
        self.server.pages.discard(self)
        if self.visitor is not None:
            self.visitor.gone()
        self._sending.cancel()


def _listen(port: int | None) -> socket.socket:
    if port is None:
        for candidate in (*PORTS, 0):
            with suppress(OSError):
                return bind_sockets(candidate, LOOPBACK, socket.AF_INET)[0]
        raise RunError(f"no free port on {LOOPBACK}")
    expect(0 < port < 65536, "port", "a number from 1 to 65535", port)
    try:
        return bind_sockets(port, LOOPBACK, socket.AF_INET)[0]
    except PermissionError:
        expected = "one above 1023 or none, for a free one"
        raise InputError(f"{port} is reserved", where="port", expected=expected) from None
    except OSError:
        expected = "a free port, or none, to have one found"
        raise InputError(f"{port} is in use", where="port", expected=expected) from None
