"""The curves of a page: what they hold, what thinning keeps, and runs that have little to show."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figure_examples import cut, run
from playback_robot import drive, hand_built_robot

import nmm
from nmm.base.errors import InputError
from nmm.base.resolver_style import looks
from nmm.motion.table import summary_rows
from nmm.motion.trajectory import Trajectory
from nmm.scenario import Scenario
from nmm.views.playback import write_html
from nmm.views.playback.channels import FPS, SEEN, Channel, channels, draw_curves
from nmm.views.playback.drawing import Drawing
from nmm.views.playback.keyframes import MOST_FRAMES


def found(trajectory: Trajectory) -> dict[str, Channel]:
    return {channel.name: channel for channel in channels(trajectory).channels}


def test_channels_are_the_columns_of_the_runs_table(tmp_path: Path) -> None:
    trajectory = run("unicycle_2r_position")
    trajectory.save(tmp_path / "run", figures=False)
    columns = np.genfromtxt(tmp_path / "run" / "trajectory.csv", delimiter=",", names=True, deletechars="")
    shown = channels(trajectory)
    assert np.array_equal(shown.t, trajectory.t)  # 50 samples a second are not thinned
    own = {"error_norm", "partition"}
    for channel in shown.channels:
        if channel.name not in own and channel.panel != "torques":
            assert np.array_equal(channel.values, columns[channel.name]), channel.name
    assert np.array_equal(found(trajectory)["error_norm"].values, trajectory.error_norm)


def switching() -> Trajectory:
    """A run whose partition goes from (v, q1) to (v, q2), and back with its columns the other way round."""
    base = run("unicycle_2r_position")
    partition = np.full_like(base.partition, -1)
    partition[:100], partition[100:101], partition[101:] = [0, 2], [0, 3], [2, 0]
    return replace(base, partition=partition)


def test_partitions_are_named_and_switch_where_the_run_does() -> None:
    trajectory = switching()
    assert channels(trajectory).partitions == ("v, q\u0307₁", "v, q\u0307₂")
    number = found(trajectory)["partition"].values
    assert np.array_equal(np.flatnonzero(number), [100])
    assert "partition" not in found(run("unicycle_2r_position", "pg"))


def test_limits_are_those_of_the_run_not_the_robots() -> None:
    settings = {"dt": 0.02, "duration": 3.0, "limits": {"velocity": {"v": 0.7}}}
    trajectory = Scenario.load("unicycle_2r_position", settings).run()
    assert trajectory.limited
    lower, upper = found(trajectory)["u_v"].limits
    assert (lower, upper) == pytest.approx((-0.7, 0.7), abs=1e-6)
    assert found(trajectory)["scale_0"].panel == "scale"


def noisy(count: int, duration: float) -> Trajectory:
    """A run of many samples: smooth, with one spike, a gap and a chattering input."""
    base = switching()
    t = np.linspace(0.0, duration, count)
    at = np.linspace(0.0, len(base) - 1.0, count)
    arrays = {
        name: np.array([np.interp(at, np.arange(len(base)), column) for column in getattr(base, name).T]).T
        for name in ("q", "u", "q_dot", "r", "r_d", "error", "path", "desired")
    }
    whole = {name: getattr(base, name)[at.astype(int)] for name in ("partition", "scale", "shares")}
    flat = {
        name: np.interp(at, np.arange(len(base)), getattr(base, name))
        for name in ("objective", "sigma_min", "residual")
    }
    arrays["u"][:, 1] += 0.3 * (-1.0) ** np.arange(count)
    flat["sigma_min"][count // 3] = 7.5
    arrays["error"][count // 2 : count // 2 + 17] = np.nan
    return replace(base, t=t, **arrays, **whole, **flat)


def test_what_is_thinned_misses_nothing_that_one_could_see() -> None:
    trajectory = noisy(20_000, 20.0)
    shown, all_of = channels(trajectory), {c.name: c for c in channels(cut(trajectory, 20_000)).channels}
    assert shown.samples == 20_000
    assert set(all_of) == {channel.name for channel in shown.channels}
    by_name = {channel.name: channel for channel in shown.channels}
    assert by_name["sigma_min"].values.max() == 7.5
    # Both ends of the gap.
    kept = np.searchsorted(trajectory.t, shown.t)
    assert {9_999, 10_000, 10_016, 10_017} <= set(kept.tolist())
    switched = np.flatnonzero(np.any(np.diff(trajectory.partition, axis=0) != 0, axis=1))
    assert {*switched.tolist(), *(switched + 1).tolist()} <= set(kept.tolist())
    # Smooth curves are drawn as they are; beside what must be kept there are at most FPS a second.
    x = trajectory.q[:, 0]
    off = np.abs(np.interp(trajectory.t, shown.t, by_name["x"].values) - x)
    assert off.max() < SEEN * np.ptp(x)
    assert len(shown.t) <= 2 * FPS * 20.0 + 200


def time_of_a_number_each(trajectory: Trajectory) -> float:
    """The machine's measure, s of processor: Python makes a number of each coordinate of each sample."""
    begun = time.thread_time()
    assert np.isfinite(sum(float(x) for x in trajectory.q.ravel()))
    return time.thread_time() - begun


def test_a_million_samples_fit_into_a_page(tmp_path: Path) -> None:
    trajectory = noisy(1_000_000, 1000.0)
    shown = channels(trajectory)
    assert shown.samples == 1_000_000
    assert len(shown.t) <= 2 * MOST_FRAMES + 200
    assert shown.t[0] == trajectory.t[0]
    assert shown.t[-1] == trajectory.t[-1]
    before = time_of_a_number_each(trajectory)
    begun = time.thread_time()
    page = write_html([trajectory], tmp_path / "page.html")
    spent = time.thread_time() - begun
    # It is 6 to 8 times that; where wheels were, sample by sample, made it seven times as much.
    assert spent < 10.0 * (before + time_of_a_number_each(trajectory))
    assert page.stat().st_size < 4e6
    assert '"samples":1000000' in page.read_text("utf-8")


def test_one_sample_and_ten_runs_and_other_robots_make_a_page(tmp_path: Path) -> None:
    short = run("unicycle_2r_position")
    one = cut(short, 1)
    assert len(channels(one).t) == 1
    motion = drive(hand_built_robot(tmp_path), duration=0.5)
    assert [channel.panel for channel in channels(motion).channels] == ["inputs"] * 5 + ["coordinates"] * 6
    page = write_html([*[cut(short, 20 + k) for k in range(9)], motion, one], tmp_path / "page.html")
    assert page.read_text("utf-8").count('"type":"curves"') == 1


def test_no_samples_are_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="t: expected at least one sample"):
        write_html([cut(run("unicycle_2r_position"), 0)], tmp_path / "page.html")
    with pytest.raises(InputError, match="at least one motion"):
        write_html([], tmp_path / "page.html")


def test_a_plans_page_opens_with_the_plan() -> None:
    """What is spare, limits and inputs; not the error of a task that it does not follow."""
    robot = nmm.load("unicycle_3r")
    limits = nmm.Limits(velocity={"platform": 1.0, "arm": 1.0}, acceleration=2.0)
    pillar = nmm.Obstacle(nmm.Box([0.4, 0.4, 1.0]), [1.5, 0.0, 0.5], name="pillar")
    plan = nmm.plan(robot, robot.rest, {"x": 3.0, "y": 0.0, "theta": 0.0}, [pillar], limits=limits)
    trajectory = plan.trajectory(0.05)
    drawing = Drawing()
    draw_curves(drawing, [channels(trajectory)], looks(["PLAN"]), 0.0)
    panels = drawing.commands[0]["panels"]
    assert [panel["id"] for panel in panels[:3]] == ["clearance", "margin", "inputs"]
    assert [panel["open"] for panel in panels] == [True] * 3 + [False] * (len(panels) - 3)
    way = dict(summary_rows(trajectory, trajectory.summary()))["way"]
    metres, turns = (float(part) for part in re.findall(r"[\d.]+", way))
    x, y, theta = trajectory.q[:, :3].T
    assert metres == pytest.approx(np.hypot(np.diff(x), np.diff(y)).sum(), rel=5e-3)
    assert metres > 2.0
    assert turns == pytest.approx(np.abs(np.diff(theta)).sum(), rel=5e-3)
