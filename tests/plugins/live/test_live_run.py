"""A run that is shown while it is computed, without a browser: what pages are told, when, and what that costs
the run."""

from __future__ import annotations

import json
import re
import signal
import threading
import time
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from command_line import page_of
from live_pages import LivePage, dead_page, live, unpacked
from ports import MOST, listening, wait_for

import nmm
from nmm.model.robots.configuration import Configuration
from nmm.motion.trajectory import Trajectory
from nmm.plugins.live.running import ALL, KEPT
from nmm.plugins.live.session import AHEAD, FPS, Watching, counted
from nmm.views.playback import LiveRun

DT = 0.005
SHORT = ("--set", "duration=0.5")
#: Not over before it is interrupted: no compiled loop computes it.
LONG = ("--set", "duration=5000", "--set", "method=adaptive")


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers are waited for as long as a busy machine needs."""
    monkeypatch.setattr("nmm.plugins.live.running.PATIENCE", MOST)


def lose_patience(shown: LiveRun, page: LivePage, monkeypatch: pytest.MonkeyPatch) -> None:
    """With pages that are silent, when the first page has drawn the last picture."""

    def drawn() -> bool:
        runs = page.of("run")
        return runs[-1]["told"] == "drawing all of it" and f"page 1 drew {len(runs)} " in shown.report()

    wait_for(lambda: bool(page.of("run")) and drawn())
    assert page.of("whole") == []
    monkeypatch.setattr("nmm.plugins.live.running.PATIENCE", 0.0)


def scenario(name: str = "unicycle_3r_position", **settings: object) -> nmm.Scenario:
    return nmm.Scenario.load(name, {"duration": 1.0, **settings})


def read_curves(page: LivePage) -> tuple[list[str], np.ndarray, np.ndarray]:
    """The channels of a page, and the times and values of the samples that it was told."""
    curves = next(json.loads(line) for line in page.hello if '"type":"curves"' in line)
    names = list(curves["runs"][0]["columns"])
    runs = page.of("run")
    t = np.concatenate([unpacked(run["t"]) for run in runs])
    values = np.concatenate([unpacked(run["values"]) for run in runs])
    return names, t, values.reshape(len(t), -1)


def same(one: Trajectory, other: Trajectory) -> None:
    for field in fields(Trajectory):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, err_msg=field.name)
    assert (one.outcome, one.message, one.warnings) == (other.outcome, other.message, other.warnings)


def test_pages_do_not_change_a_run_and_are_told_its_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, with a page that draws, one that never answers, and one that never reads."""
    one = scenario()
    alone = one.run()
    with live(one) as (shown, run):
        with LivePage(shown.url) as page, LivePage(shown.url, answers=False) as silent, dead_page(shown.url):
            made = run()
            same(made, alone)
            lose_patience(shown, page, monkeypatch)
            wait_for(lambda: bool(page.of("whole")))
            wait_for(lambda: bool(silent.of("whole")))
        names, t, values = read_curves(page)
        assert t[0] == 0.0
        assert t[-1] == made.t[-1]
        assert np.all(np.diff(t) > 0.0)
        at = np.searchsorted(made.t, t)
        np.testing.assert_array_equal(made.t[at], t)
        expected = {
            "error_norm": made.error_norm, "objective": made.objective, "sigma_min": made.sigma_min,
            "residual": made.residual,
            **{f"u_{name}": made.u[:, i] for i, name in enumerate(made.robot.u_names)},
            **{name: made.q[:, i] for i, name in enumerate(made.robot.q_names)},
            **{f"error_{name}": made.error[:, i] for i, name in enumerate(made.r_names)},
        }  # fmt: skip
        assert set(expected) == set(names) - {"partition"}
        for name, whole in expected.items():
            column = values[:, names.index(name)]
            np.testing.assert_allclose(column, whole[at], rtol=1e-6, atol=1e-9, err_msg=name)
        # Behind the curves come the path and where it shall be.
        assert made.path is not None
        assert made.desired is not None
        np.testing.assert_allclose(values[:, len(names) : len(names) + 3], made.path[at], atol=1e-6)
        np.testing.assert_allclose(values[:, len(names) + 3 :], made.desired[at], atol=1e-6)
        # Those of curves, and that of each picture: more than FPS a second where the run was waited for.
        assert len(t) <= KEPT * made.t[-1] + page.of("run")[-1]["picture"] + 2


def test_the_robot_is_drawn_where_it_is() -> None:
    one = scenario()
    with live(one) as (shown, run), LivePage(shown.url) as page:
        made = run()
        wait_for(lambda: bool(page.of("whole")))
        pose, *_ = reversed(page.of("pose"))
    matrices = {path: np.reshape(matrix, (4, 4)).T for path, matrix in pose["transforms"]}
    robot, chain = made.robot, np.eye(4)
    for path in sorted(matrices, key=len):
        if path.endswith(("/x", "/y", "/theta")):
            chain = chain @ matrices[path]
    np.testing.assert_allclose(chain[:2, 3], made.q[-1, :2], atol=1e-9)
    expected = Configuration(robot, made.q[-1]).placement("base_footprint")
    np.testing.assert_allclose(chain[:2, :2], expected.rotation[:2, :2], atol=1e-9)


def test_time_passes_as_it_does_on_the_wall_and_pictures_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """What could not be made in time is counted, too: nothing is lost without a word."""
    one = scenario(duration=2.0)
    with live(one) as (shown, run):
        began = time.monotonic()
        with LivePage(shown.url) as page, LivePage(shown.url, answers=False) as silent:
            run()
            lose_patience(shown, page, monkeypatch)
            wait_for(lambda: bool(page.of("whole")))
            passed = time.monotonic() - began
        pictures = [run["picture"] for run in page.of("run")]
        waits = sum(run["told"].startswith("waits") for run in page.of("run"))
        report = shown.report()
    assert passed >= 2.0
    assert pictures == sorted(set(pictures))
    found = re.search(r"(\d+) pictures of 2 s;(?: (\d+) could not be made in time;)?", report)
    assert found, report
    made, late = int(found[1]), int(found[2] or 0)
    assert made + late >= 0.9 * 2.0 * FPS
    drew, dropped = (int(text) for text in re.findall(r"page 1 drew (\d+) and dropped (\d+)", report)[0])
    assert drew == len(pictures)
    assert drew + dropped == made
    # Some more while the run was waited for, and time stood.
    assert made <= 2.0 * FPS + 4 + waits + dropped + late
    # One that says nothing is sent no more than what may be on its way.
    assert len(silent.of("run")) == AHEAD
    assert f"page 2 drew 0 and dropped {made - AHEAD}" in report


def test_a_page_that_comes_late_is_told_everything_so_far() -> None:
    one = scenario(duration=60.0)  # however late: it is not over by itself
    with live(one) as (shown, run), LivePage(shown.url) as first:
        run()
        wait_for(lambda: any(unpacked(each["t"]).max(initial=0.0) > 0.2 for each in first.of("run")))
        with LivePage(shown.url) as late:
            wait_for(lambda: bool(late.of("run")))
            run_told = late.of("run")[0]
            t = unpacked(run_told["t"])
            assert t[0] == 0.0
            assert t[-1] > 0.2
            wait_for(lambda: first.of("run")[-1]["whole"])  # then a page can be told all of it
            first.says(ALL)
            wait_for(lambda: bool(late.of("whole")) and bool(first.of("whole")))
        np.testing.assert_array_equal(read_curves(late)[1], read_curves(first)[1])
        # One that comes after the end gets what `nmm play` shows.
        with LivePage(shown.url) as after:
            stage = next(json.loads(line) for line in after.hello if '"type":"stage"' in line)
            assert stage["live"] is False
            assert stage["duration"] == pytest.approx(60.0)
            time.sleep(0.2)
            assert after.told == []


def test_the_clock_stands_until_somebody_looks() -> None:
    with live(scenario()) as (shown, run):
        run()
        time.sleep(0.3)
        assert shown.report() == "shown as it ran: 1 pictures of 0 s; no page was open"
        with LivePage(shown.url) as page:
            wait_for(lambda: bool(page.of("run")))
            page.says(ALL)
            wait_for(lambda: bool(page.of("whole")))
            assert read_curves(page)[1][0] == 0.0


def test_a_run_slower_than_its_own_time_is_waited_for() -> None:
    """And then a page is told so; nothing is shown before it is known."""
    one = scenario("unicycle_2r_position", duration=0.3)
    usual = one.controller()

    def slow(here: Configuration) -> float:
        time.sleep(3e-4)
        return float(here.placement("ee").translation[0])

    task = nmm.Task(nmm.CallableFunction(slow, ["ahead"]), 1.0)
    controller = nmm.Controller(usual.robot, task, nmm.ProjectedGradient())
    with LiveRun(controller, one.parts.q0, 0.3, open_browser=False) as shown, LivePage(shown.url) as page:
        made = nmm.simulate(controller, one.parts.q0, 0.3, DT, watch=shown.watch)
        stop = threading.Event()
        staying = threading.Thread(target=shown.stay, args=(made,), kwargs={"stop": stop})
        staying.start()
        wait_for(lambda: bool(page.of("whole")))
        stop.set()
        staying.join(timeout=MOST)
    words = [run["told"] for run in page.of("run")]
    assert any(re.fullmatch(r"waits for the computation, at 0\.\d+ times real time", text) for text in words)
    np.testing.assert_array_equal(read_curves(page)[1], made.t[np.searchsorted(made.t, read_curves(page)[1])])


def test_tasks_that_come_and_go_have_curves_where_they_are_active() -> None:
    one = scenario("unicycle_3r_sequence", duration=6.0)
    with live(one) as (shown, run), LivePage(shown.url) as page:
        made = run()
        wait_for(lambda: len(page.of("run")) > 4 and page.of("run")[-1]["whole"])
        page.says(ALL)
        wait_for(lambda: bool(page.of("whole")))
        names, t, values = read_curves(page)
    at = np.searchsorted(made.t, t)
    assert made.events
    for i, name in enumerate(made.r_names):
        column = values[:, names.index(f"error_{name}")]
        np.testing.assert_allclose(column, made.error[at, i], rtol=1e-5, atol=1e-7, err_msg=name)
    assert np.isnan(made.error[at]).any()


def test_an_answer_counts_once_and_others_count_nothing() -> None:
    page = Watching(4)
    assert page.takes(5)
    assert not page.takes(5)
    assert page.takes(7)
    assert not page.takes(8)  # two are on their way
    assert page.dropped(7) == 1
    for text in (
        "", "null", "[]", "{", b"\xff", "[" * 3000, '{"type":"drawn"}', '{"type":"all"}',
        '{"type":"drawn","picture":7,"drawn":3}',
        '{"type":"drawn","picture":8,"drawn":1}', '{"type":"drawn","picture":4,"drawn":1}',
        '{"type":"drawn","picture":true,"drawn":1}', '{"type":"drawn","picture":5.0,"drawn":1}',
        '{"type":"drawn","picture":5,"drawn":0}', '{"type":"drawn","picture":5,"drawn":"1"}',
        '{"type":"order","picture":5,"drawn":1}', '{"type":"drawn","picture":5,"drawn":1,"more":1}',
        '{"type":"drawn","picture":%s,"drawn":1}' % ("9" * 3000),
    ):  # fmt: skip
        assert not page.heard(text)
        assert page.drawn == 0
    assert page.heard('{"type":"drawn","picture":5,"drawn":1}')
    assert not page.heard('{"type":"drawn","picture":5,"drawn":1}')
    assert page.takes(8)
    assert page.heard('{"type":"drawn","picture":8,"drawn":2}')
    assert (page.drawn, page.dropped(8), page.has_drawn(8), page.has_drawn(9)) == (2, 2, True, False)
    page.leaves(10)
    assert page.dropped(50) == 4
    assert counted([], 3) == "no page was open"
    assert counted([page], 50) == "the page drew 2 and dropped 4"


# the command


def test_the_command_shows_computes_and_plays(tmp_path: Path) -> None:
    scenario("unicycle_2r_position", duration=0.5).run().save(tmp_path / "plain", figures=False)
    running, url = page_of(tmp_path, "run", "--play", "unicycle_2r_position", *SHORT, "--out", "shown")
    with LivePage(url) as page:
        wait_for(lambda: bool(page.of("whole")))
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=MOST)
    assert (running.returncode, err) == (0, "")
    assert re.search(r"shown as it ran: \d+ pictures of 0\.5 s; .*the page drew \d+ and dropped \d+", out)
    with (
        np.load(tmp_path / "plain/trajectory.npz") as plain,
        np.load(tmp_path / "shown/trajectory.npz") as shown,
    ):
        assert set(plain.files) == set(shown.files)
        for name in plain.files:
            np.testing.assert_array_equal(plain[name], shown[name], err_msg=name)


def test_ended_while_the_folder_is_written_it_does_not_stay(tmp_path: Path) -> None:
    """Numbers come before figures: Ctrl-C in between neither spoils the folder nor is lost."""
    running, _ = page_of(tmp_path, "run", "--play", "unicycle_2r_position", *SHORT, "--out", "here")
    assert running.stdout is not None
    while not (line := running.stdout.readline()).startswith("outcome"):
        assert line
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=MOST)
    assert (running.returncode, err) == (0, "")
    assert "files in" in out
    assert (tmp_path / "here/motion.png").exists()


@pytest.mark.parametrize("name", ["SIGINT", pytest.param("SIGKILL", marks=pytest.mark.thorough)])
def test_nothing_stays_behind(tmp_path: Path, name: str) -> None:
    """Ended in the middle of a long run."""
    running, url = page_of(tmp_path, "run", "--play", "unicycle_2r_position", *LONG, "--out", "here")
    port = int(url.rsplit(":", 1)[1].strip("/"))
    assert listening()[port] == "0100007F"
    with LivePage(url) as page:
        wait_for(lambda: bool(page.of("run")) and unpacked(page.of("run")[-1]["t"]).size > 0)
        running.send_signal(getattr(signal, name))
        _, err = running.communicate(timeout=MOST)
        wait_for(lambda: page.closed)
    wait_for(lambda: port not in listening())
    if name == "SIGKILL":
        assert running.returncode == -signal.SIGKILL
        assert list(tmp_path.iterdir()) == []
    else:
        assert running.returncode == 1
        assert re.search(r"nmm run: RG interrupted: interrupted after .* s of 5000 s", err)
        assert (tmp_path / "here/summary.json").exists()
