"""Ports that a process listens on, programs that show a page there, and a process that plays."""

from __future__ import annotations

import functools
import http.server
import socket
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

#: Waited at most for what comes at once on an idle machine, s: a busy one may take its time.
MOST = 60.0


def listening() -> dict[int, str]:
    """Ports that something on this machine listens on, with the address, as the kernel says."""
    found = {}
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text(encoding="ascii").splitlines()[1:]:
            _, local, _, state = line.split()[:4]
            if state == "0A":
                address, port = local.split(":")
                found[int(port, 16)] = address
    return found


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(condition: Callable[[], bool], timeout: float = MOST) -> None:
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


PLAYER = """
    import sys
    from pathlib import Path
    sys.path.insert(0, {tests!r})
    from playback_robot import drive, hand_built_robot
    from nmm.views.playback import play
    play([drive(hand_built_robot(Path({folder!r})), duration=1.0)], port={port}, open_browser=False)
    print("returned")
"""


def start_player(folder: Path) -> tuple[subprocess.Popen[str], int]:
    """A process that plays live, and its port."""
    port = free_port()
    code = textwrap.dedent(PLAYER).format(tests=str(Path(__file__).parent), folder=str(folder), port=port)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    # It listens before it says where: ended in between, it would have said nothing.
    assert process.stdout is not None
    said = process.stdout.readline()
    assert f"http://127.0.0.1:{port}/" in said
    assert listening().get(port) == "0100007F"
    return process, port


@contextmanager
def served(program: Callable[..., object], *arguments: object, **options: object) -> Iterator[str]:
    """The address at which a program shows a page, which ends when it is told to and frees its port."""
    stop, port = threading.Event(), free_port()
    settings = {"port": port, "open_browser": False, "stop": stop, **options}
    thread = threading.Thread(target=program, args=arguments, kwargs=settings)
    thread.start()
    try:
        wait_for(lambda: port in listening())
        yield f"http://127.0.0.1:{port}/"
    finally:
        stop.set()
        thread.join(timeout=MOST)
    assert not thread.is_alive()
    assert port not in listening()


@contextmanager
def served_folder(folder: Path) -> Iterator[str]:
    """The address, without a stroke at its end, at which a folder's files are served."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
