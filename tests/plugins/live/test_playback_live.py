"""The live viewer without a browser: who can reach it, what it does with bad pages, and its end."""

from __future__ import annotations

import signal
import socket
import threading
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from live_pages import dead_page
from playback_robot import drive, hand_built_robot, straight
from ports import MOST, free_port, listening, start_player, wait_for

from nmm.base.errors import InputError, RunError
from nmm.model.robots.robot import Robot
from nmm.plugins.live import server
from nmm.views.playback import LiveViewer, play, wheel_angles


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return hand_built_robot(tmp_path_factory.mktemp("robot"))


def test_the_server_listens_on_loopback_only_and_ends(robot: Robot) -> None:
    before = {*threading.enumerate()}
    with LiveViewer(robot) as viewer:
        port = int(viewer.url.rsplit(":", 1)[1].strip("/"))
        assert listening()[port] == "0100007F"
        with urllib.request.urlopen(viewer.url, timeout=MOST) as answer:
            assert b"MeshCat" in answer.read()
    assert port not in listening()
    assert {*threading.enumerate()} <= before  # others' may have ended meanwhile
    viewer.close()
    with pytest.raises(RunError, match="closed"):
        viewer.display(np.zeros(6))


def test_the_server_does_not_answer_to_other_names(robot: Robot) -> None:
    with LiveViewer(robot) as viewer:
        request = urllib.request.Request(viewer.url, headers={"Host": "example.org"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(request, timeout=MOST)


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_a_port_that_is_none_is_refused(robot: Robot, port: int) -> None:
    with pytest.raises(InputError, match="from 1 to 65535"):
        LiveViewer(robot, port=port)


def test_a_port_in_use_is_refused(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is asked for; of those that are tried when none is, the next is taken."""
    with LiveViewer(robot) as viewer:
        port = int(viewer.url.rsplit(":", 1)[1].strip("/"))
        with pytest.raises(InputError, match=f"port: {port} is in use"):
            play([drive(robot, duration=1.0)], port=port, open_browser=False)
        monkeypatch.setattr(server, "PORTS", (port,))
        with LiveViewer(robot) as other:
            assert other.url != viewer.url


def test_a_page_that_never_reads_holds_up_nobody(robot: Robot) -> None:
    with LiveViewer(robot) as viewer, dead_page(viewer.url):
        # Seconds on a busy machine; held up, the loop would not come to its end.
        for k in range(2000):
            viewer.display(np.full(6, 1e-3 * k))
        viewer.close()
        assert int(viewer.url.rsplit(":", 1)[1].strip("/")) not in listening()
        assert not [one for one in threading.enumerate() if one.name.startswith("nmm playback")]


def test_wheels_roll_from_pose_to_pose(robot: Robot) -> None:
    motion = straight(robot, 0.5, 0.7, np.linspace(0.0, 2.0, 50))
    with LiveViewer(robot, motion.q[0]) as viewer:
        for q in motion.q:
            viewer.display(q)
        np.testing.assert_allclose(viewer.shown.now[1], wheel_angles(motion)[-1], atol=1e-12)
        viewer.display(motion.q[0], [1.0, 2.0])
        np.testing.assert_array_equal(viewer.shown.now[1], [1.0, 2.0])
        with pytest.raises(InputError, match="wheel_angles: expected 2 numbers"):
            viewer.display(motion.q[0], [1.0])


def test_playing_ends_when_asked(robot: Robot) -> None:
    stop = threading.Event()
    port = free_port()
    options = {"port": port, "open_browser": False, "stop": stop}
    player = threading.Thread(target=play, args=([drive(robot, duration=1.0)],), kwargs=options)
    player.start()
    wait_for(lambda: port in listening())
    stop.set()
    player.join(timeout=MOST)
    assert not player.is_alive()
    assert port not in listening()


def children(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()


@pytest.mark.parametrize(
    ("number", "status"),
    [
        (signal.SIGINT, 0),
        pytest.param(signal.SIGTERM, -signal.SIGTERM, marks=pytest.mark.thorough),
        pytest.param(signal.SIGKILL, -signal.SIGKILL, marks=pytest.mark.thorough),
    ],
)
def test_nothing_stays_behind(tmp_path: Path, number: signal.Signals, status: int) -> None:
    process, port = start_player(tmp_path)
    assert children(process.pid) == []
    with socket.create_connection(("127.0.0.1", port), timeout=MOST):
        process.send_signal(number)
        output, _ = process.communicate(timeout=MOST)
    assert process.returncode == status
    assert ("returned" in output) == (number == signal.SIGINT)
    assert port not in listening()
