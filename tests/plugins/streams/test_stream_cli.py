"""nmm run --stream."""

from __future__ import annotations

import re
import signal
import socket
import threading
from pathlib import Path

import numpy as np
import pytest
from command_line import process
from ports import MOST, free_port, listening, wait_for
from streamed import FoxgloveClient, by_foxglove, by_rerun, rerun_viewer, said_of

import nmm
from nmm.cli.exit_status import status_of
from nmm.plugins.streams.cli import Streams, Wanted

pytest.importorskip("foxglove")
pytest.importorskip("mcap_protobuf")
RUN = ["run", "unicycle_2r_position", "--set", "duration=0.5", "--set", "dt=0.01"]


def test_files_are_written_beside_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert status_of([*RUN, "--out", "run", "--stream", "foxglove=run.mcap"]) == 0
    assert "written for foxglove: run.mcap" in capsys.readouterr().out
    run, found = nmm.Trajectory.load("run"), by_foxglove(Path("run.mcap"))
    np.testing.assert_array_equal([message["v"] for _, message in found["/inputs"]], run.u[:, 0])
    assert {one.name for one in tmp_path.iterdir()} == {"run", "run.mcap"}


def test_a_run_that_fails_is_in_its_file_as_far_as_it_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from nmm.motion.closed_loop import _Loop

    own = _Loop._pass_over

    def breaks(loop: _Loop, k: int, last: int) -> tuple[int, bool]:
        if k >= 20:
            raise nmm.RunError("a wheel came off")
        return own(loop, k, min(last, 20))

    monkeypatch.setattr(_Loop, "_pass_over", breaks)
    monkeypatch.chdir(tmp_path)
    assert status_of([*RUN, "--out", "run", "--stream", "foxglove=run.mcap"]) == 1
    run, said = nmm.Trajectory.load("run"), said_of(Path("run.mcap"))
    assert len(run) == 21
    assert (said["complete"], said["outcome"]) == ("no", "failed")
    assert "a wheel came off" in said["why"]
    assert len(by_foxglove(Path("run.mcap"))["/tf"]) == len(run)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("vlc", "unknown tool 'vlc'; available: rerun, foxglove"),
        ("foxglove=run.rrd", "expected foxglove, foxglove:PORT or foxglove=FILE.mcap"),
        ("foxglove:port", "expected foxglove, foxglove:PORT or foxglove=FILE.mcap"),
        ("foxglove:" + "1" * 5000, "expected foxglove, foxglove:PORT or foxglove=FILE.mcap"),
        ("foxglove:99999", "expected foxglove, foxglove:PORT or foxglove=FILE.mcap"),
        ("foxglove:1=run.mcap", "expected foxglove, foxglove:PORT or foxglove=FILE.mcap"),
        ("foxglove=.", "expected foxglove"),
    ],
)
def test_bad_input_ends_before_the_run(
    text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert status_of([*RUN, "--stream", text]) == 2
    assert said in capsys.readouterr().err
    assert [*tmp_path.iterdir()] == []


def test_without_a_viewer_of_rerun_nothing_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(nmm.Scenario, "controller", None)  # a plan, where one is made, is not begun
    assert status_of([*RUN, "--stream", f"rerun:{free_port()}"]) == 2
    assert "no viewer of Rerun" in capsys.readouterr().err
    assert [*tmp_path.iterdir()] == []


def test_foxglove_sees_a_run_while_it_is_computed(tmp_path: Path) -> None:
    """In its own time; the server is gone when it is over. Who comes misses what goes on until all is
    subscribed to, and the server does not wait in the end for one that is slow: what came is of the run."""
    port = free_port()
    running = process(tmp_path, *RUN, "--set", "duration=3", "--out", "run", "--stream", f"foxglove:{port}")
    try:
        wait_for(lambda: port in listening() or running.poll() is not None, 4 * MOST)
        client = FoxgloveClient(f"ws://127.0.0.1:{port}")
        _out, err = running.communicate(timeout=4 * MOST)
    finally:
        running.kill()
    wait_for(lambda: client.gone)
    run = nmm.Trajectory.load(tmp_path / "run")
    assert running.returncode == (0 if run.complete else 1), err
    assert port not in listening()
    stamps = [stamp for _, stamp, _, _ in client.of("/tf")]
    assert 1 < len(stamps) <= 181
    assert stamps[-1] - stamps[0] >= 1e9 * ((len(stamps) - 1) / 60 - 0.01) - 1000
    assert all(stamp <= came for _, stamp, _, came in client.messages)
    rows = [[one[name] for name in run.robot.u_names] for _, _, one, _ in client.of("/inputs")]
    at = [int(np.flatnonzero((run.u == row).all(axis=1))[0]) for row in rows]  # each is a sample's
    assert at == sorted(at)
    assert len({*at}) > 1


def test_a_planned_motion_is_shown_when_it_is_there() -> None:
    run, port = nmm.Scenario.load("unicycle_2r_position", {"duration": 3.0}).run(), free_port()
    ending = threading.Thread(target=Streams([Wanted("foxglove", None, port)], []).end, args=(run, False))
    ending.start()
    wait_for(lambda: port in listening())
    client = FoxgloveClient(f"ws://127.0.0.1:{port}")
    ending.join(MOST)
    wait_for(lambda: client.gone)
    assert 0 < len(client.of("/tf")) <= 181
    assert port not in listening()


def test_rerun_sees_a_run_while_it_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("nmm.plugins.streams.sinks.PATIENCE", MOST)
    with rerun_viewer(tmp_path / "seen.rrd") as (port, _):
        assert status_of([*RUN, "--out", "run", "--stream", f"rerun:{port}"]) == 0
        assert re.search(rf"rerun\+http://127\.0\.0\.1:{port}/proxy", capsys.readouterr().out)
    run, found = nmm.Trajectory.load(tmp_path / "run"), by_rerun(tmp_path / "seen.rrd")
    last = [found[f"/inputs/{name}"]["Scalars:scalars"][-1][0] for name in run.robot.u_names]
    np.testing.assert_array_equal(last, run.u[-1])
    assert found["/__properties/nmm"]["outcome"] == [["completed"]]


def test_ctrl_c_ends_a_live_run_and_its_server(tmp_path: Path) -> None:
    port = free_port()
    running = process(tmp_path, "run", "unicycle_2r_position", "--out", "run", "--stream", f"foxglove:{port}")
    try:
        wait_for(lambda: port in listening() or running.poll() is not None, 4 * MOST)
        client = FoxgloveClient(f"ws://127.0.0.1:{port}")
        wait_for(lambda: len(client.of("/tf")) > 3 and (tmp_path / "run" / "summary.json").exists(), 4 * MOST)
        running.send_signal(signal.SIGINT)
        _out, err = running.communicate(timeout=4 * MOST)
    except BaseException:
        running.kill()
        raise
    wait_for(lambda: client.gone)
    assert port not in listening()
    assert running.returncode == 0, err
    assert "Traceback" not in err
    assert nmm.Trajectory.load(tmp_path / "run").complete


def test_a_server_that_cannot_listen_ends_before_the_run(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        running = process(tmp_path, *RUN, "--stream", f"foxglove:{taken.getsockname()[1]}")
        _, err = running.communicate(timeout=4 * MOST)
    assert running.returncode == 2
    assert "Address already in use" in err
    assert [*tmp_path.iterdir()] == []


def test_a_stream_that_cannot_be_written_loses_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run is in its folder, the other stream in its file."""
    monkeypatch.chdir(tmp_path)
    Path("there").mkdir()
    own = Streams.end

    def late(streams: Streams, run: nmm.Trajectory, asked: bool) -> None:
        Path("there").rmdir()  # while the run was computed
        own(streams, run, asked)

    monkeypatch.setattr(Streams, "end", late)
    streams = ["--stream", "foxglove=there/run.mcap", "--stream", "foxglove=run.mcap"]
    assert status_of([*RUN, "--out", "run", *streams]) == 1
    told = capsys.readouterr().err
    assert re.search(r"nmm run: .*there.*; the run is in run$", told, re.MULTILINE)
    assert "Traceback" not in told
    assert len(by_foxglove(Path("run.mcap"))["/tf"]) == len(nmm.Trajectory.load("run"))


@pytest.mark.parametrize("where", ["watch", "end", "exit"])
def test_what_fails_beside_a_run_does_not_end_it(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever a plugin raises, and whenever; what else goes on beside the run is told of its end."""
    from collections.abc import Iterator
    from contextlib import contextmanager

    from nmm.base.plugins import Beside
    from nmm.plugins.streams.cli import StreamOptions

    asked = list[str]()

    class Breaks(Beside):
        def watch(self, recorder: object) -> None:
            asked.append("watch")
            assert where != "watch", "out of order"

        def end(self, run: object, asked_to: bool) -> None:
            asked.append("end")
            assert where != "end", "out of order"

    @contextmanager
    def beside(options: StreamOptions, scenario: object, controller: object) -> Iterator[Beside]:
        yield Breaks()
        assert where != "exit", "out of order"

    monkeypatch.setattr(StreamOptions, "beside", beside)
    monkeypatch.chdir(tmp_path)
    assert status_of([*RUN, "--out", "run"]) == 1
    assert asked == ["watch", "end"]
    run, told = nmm.Trajectory.load("run"), capsys.readouterr().err
    assert run.complete
    assert len(run) == 51
    (line,) = [one for one in told.splitlines() if "out of order" in one]
    assert line.startswith("nmm run: AssertionError: out of order")
