"""Figures: what they show is the robot's, everything is inside, labelled and legible; no global state."""

from __future__ import annotations

import io
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from figure_examples import PAPER, check_legible, cut, drawn_points, run
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from nmm import figures
from nmm.base.errors import InputError
from nmm.control.controller import Controller
from nmm.control.functions.tasks import Heading, LinearCoordinates, Position, Task
from nmm.control.resolvers import ProjectedGradient
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot
from nmm.motion.simulation import simulate
from nmm.motion.trajectory import Trajectory
from nmm.scenario import Scenario
from nmm.views.figures import style

#: Where the packages of example-robot-data are.
SHARE = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix" / "share"


def two(trajectory: Trajectory) -> list[Trajectory]:
    """A trajectory and the same by another name."""
    return [trajectory, replace(trajectory, resolver="pg")]


#: Every figure of one run, by name.
KINDS: dict[str, Callable[[Trajectory], Figure]] = {
    "stroboscopic": figures.stroboscopic,
    "errors": figures.errors,
    "tracking": figures.tracking,
    "inputs": figures.inputs,
    "coordinates": figures.coordinates,
    "singular_values": figures.singular_values,
    "objective": lambda trajectory: figures.objective_comparison(two(trajectory)),
    "overview": figures.overview,
    "comparison": lambda trajectory: figures.comparison(two(trajectory)),
}


#: What of the paper's other cases differs from that of the last by more than numbers.
DIFFERENT = {PAPER[0]: ("stroboscopic", "overview"), PAPER[1]: ("stroboscopic", "errors", "overview"),
             PAPER[2]: ("stroboscopic",), PAPER[3]: (*KINDS,)}  # fmt: skip


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for name in PAPER for kind in DIFFERENT[name]])
def test_figures_of_the_paper_are_legible(name: str, kind: str) -> None:
    check_legible(KINDS[kind](run(name)))


@pytest.mark.parametrize("name", PAPER)
def test_robot_and_paths_are_inside_the_axes(name: str) -> None:
    made = figures.stroboscopic(run(name))
    assert len(made.axes) == (2 if name == "unicycle_3r_position" else 1)
    for axes in made.axes:
        points = drawn_points(axes)
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        assert np.all((points[:, 0] > left) & (points[:, 0] < right))
        assert np.all((points[:, 1] > low) & (points[:, 1] < high))
        # A metre is as long up the page as across it.
        box = axes.get_position().transformed(made.transSubfigure)
        assert box.width / (right - left) == pytest.approx(box.height / (high - low), rel=1e-6)


def test_no_pyplot_and_no_global_state() -> None:
    before = dict(matplotlib.rcParams)
    KINDS["overview"](run(PAPER[0])).canvas.draw()
    assert dict(matplotlib.rcParams) == before
    found = subprocess.run(
        [sys.executable, "-c", "import sys, nmm.figures; print('matplotlib.pyplot' in sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.strip() == "False"


def test_figures_drawn_in_threads_are_the_same(tmp_path: Path) -> None:
    trajectory = run(PAPER[0])

    def draw(name: str) -> bytes:
        folder = tmp_path / name
        folder.mkdir()
        figures.write_run_figures(trajectory, folder)
        return b"".join(path.read_bytes() for path in sorted(folder.iterdir()))

    alone = draw("alone")
    with ThreadPoolExecutor(2) as pool:
        assert set(pool.map(draw, "ab")) == {alone}


def test_run_folder_gets_its_figures(tmp_path: Path) -> None:
    written = figures.write_run_figures(run(PAPER[1]), tmp_path)
    assert {path.name for path in written} == {"motion.png", "errors.png", "inputs.png", "objective.png"}
    for path in written:
        assert path.read_bytes().startswith(b"\x89PNG")


def bare_run(robot: Robot, task: Task, *more: Task) -> Trajectory:
    controller = Controller(robot, [task, *more], ProjectedGradient())
    return simulate(controller, robot.q({"q1": 0.3, "q2": 0.4}), 1.0, 0.01)


def test_run_without_position_task_and_objective(robot_2r: Robot, tmp_path: Path) -> None:
    trajectory = bare_run(robot_2r, Task(Heading("link1"), 1.0))
    assert trajectory.path is None
    for kind, make in KINDS.items():
        if kind != "objective":
            check_legible(make(trajectory))
    written = figures.write_run_figures(trajectory, tmp_path)
    assert {path.name for path in written} == {"motion.png", "errors.png", "inputs.png"}


def test_run_with_as_many_rows_as_inputs(robot_2r: Robot) -> None:
    trajectory = bare_run(
        robot_2r, Task(Position("ee", "xy"), [1.5, 0.2]), Task(LinearCoordinates("q1", "q2"), [0.5, 0.1])
    )
    assert trajectory.complete
    for make in KINDS.values():
        check_legible(make(trajectory))


@pytest.mark.parametrize(("name", "count"), [(PAPER[3], 1), (PAPER[0], 2), (PAPER[3], 40)])
def test_incomplete_runs(name: str, count: int) -> None:
    for make in KINDS.values():
        check_legible(make(cut(run(name), count)))


def test_a_held_target_is_marked_and_no_path() -> None:
    """What a robot is to reach, or stretches towards, is in the picture and in the legend."""
    held = run("unicycle_3r_out_of_reach", "dls")
    np.testing.assert_array_equal(held.marks, [[2.0, 1.0, 2.0]])
    assert (held.motion().desired, held.motion().target) == (None, pytest.approx(held.marks))
    for made in (figures.stroboscopic(held), figures.comparison(two(held))):
        check_legible(made)
        marked = [line for axes in made.axes for line in axes.lines if line.get_label() == "target"]
        assert marked
        assert not [line for axes in made.axes for line in axes.lines if line.get_label() == "desired path"]
        np.testing.assert_array_equal(marked[0].get_xydata(), held.marks[:, :2])
    moved = run(PAPER[0])
    assert (len(moved.held), len(moved.marks)) == (0, 0)
    np.testing.assert_array_equal(moved.motion().desired, moved.desired)


@pytest.mark.parametrize(
    ("name", "across"),
    [(PAPER[0], []), ("panda_mecanum_pose", ["y [m]"]), ("unicycle_3r_vertical_line", ["x [m]"])],
)
@pytest.mark.parametrize("width", [10.4, 3.5])
def test_compared_paths_are_drawn_in_the_planes_in_which_they_lie(
    name: str, across: list[str], width: float
) -> None:
    """Those that rise from the side, too; all of them inside the axes, a metre as long up as across."""
    runs = two(run(name))
    made = figures.comparison(runs, width=width)
    check_legible(made)
    sides = [axes for axes in made.axes if axes.get_ylabel() == "z [m]"]
    assert [axes.get_xlabel() for axes in sides] == across
    path = runs[0].path
    assert path is not None
    rows = {"x [m]": 0, "y [m]": 1, "z [m]": 2}
    views = [axes for axes in made.axes if axes.get_ylabel() in ("y [m]", "z [m]")]
    for axes in views:
        seen = path[:, [rows[axes.get_xlabel()], rows[axes.get_ylabel()]]]
        drawn = [line.get_xydata() for line in axes.lines if line.get_label() == f"RG: {runs[0].frame}"]
        np.testing.assert_allclose(drawn[0], seen, atol=1e-12)
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        points = np.vstack([line.get_xydata() for line in axes.lines])
        assert np.all((points > [left, low]) & (points < [right, high]))
        box = axes.get_position().transformed(made.transSubfigure)
        assert box.width / (right - left) == pytest.approx(box.height / (high - low), rel=1e-6)
    assert len(views) == 1 + len(across)
    if width > 6.0:  # no empty corner: panels reach as far down at the left as at the right, or nearly
        lowest = [
            min(box.y0 for box in boxes)
            for boxes in (
                [axes.get_position() for axes in made.axes if axes.get_position().x0 < 0.5],
                [axes.get_position() for axes in made.axes if axes.get_position().x0 > 0.5],
            )
        ]
        assert abs(lowest[0] - lowest[1]) * made.get_figheight() < 2.0


def test_runs_without_a_sample_are_refused() -> None:
    empty = cut(run(PAPER[0]), 0)
    for make in (KINDS["stroboscopic"], KINDS["objective"], KINDS["overview"], KINDS["comparison"]):
        with pytest.raises(InputError, match="at least one sample"):
            make(empty)


def test_diverged_run() -> None:
    trajectory = run(PAPER[0], method="euler", resolver__alpha=900)
    assert not trajectory.complete
    for make in KINDS.values():
        check_legible(make(trajectory))
    texts = {text.get_text() for axes in figures.overview(trajectory).axes for text in axes.texts}
    assert "run diverged" in texts


def test_long_run_is_drawn_with_few_points() -> None:
    run_ = run(PAPER[0])
    many = np.tile(np.arange(len(run_)), 40)
    arrays = {name: getattr(run_, name)[many] for name in ("q", "u", "error", "objective", "path", "desired")}
    long = replace(run_, t=np.arange(len(many)) * run_.dt, **arrays)
    for make in (figures.errors, figures.inputs, figures.stroboscopic):
        written = io.BytesIO()
        make(long).savefig(written, format="svg")
        assert len(written.getvalue()) < 1_000_000  # more than 10 MB with all 200,000


def test_instants() -> None:
    trajectory = run(PAPER[0])
    at = [0.0, 3.0, 25.0]
    labels = {text.get_text() for text in figures.stroboscopic(trajectory, at).axes[0].texts}
    assert labels == {"0 s", "3 s", "25 s"}
    assert len(figures.stroboscopic(trajectory, 5).axes[0].texts) == 5
    for wrong in ([26.0], [-1.0], [], [np.nan]):
        with pytest.raises(InputError, match=r"instants: expected times from 0 s to 25 s"):
            figures.stroboscopic(trajectory, wrong)
    with pytest.raises(InputError, match="at least 1"):
        figures.stroboscopic(trajectory, 0)


def test_slow_robots_are_drawn_fewer_times() -> None:
    """A platform that hardly moves is not drawn eleven times over itself."""
    few = figures.stroboscopic(run("unicycle_2r_manipulability")).axes[0].texts
    many = figures.stroboscopic(run(PAPER[0])).axes[0].texts
    assert len(few) < len(many) == 11


def test_switches_of_partition_are_marked() -> None:
    trajectory = run("unicycle_2r_switching")
    assert trajectory.switches > 0
    axes, band = figures.singular_values(trajectory).axes
    marks = [line for line in axes.lines if len(set(line.get_xdata())) == 1]
    switched = np.flatnonzero(np.any(np.diff(trajectory.partition, axis=0) != 0, axis=1)) + 1
    np.testing.assert_allclose([line.get_xdata()[0] for line in marks], trajectory.t[switched])
    assert len(band.patches) == trajectory.switches + 1


def test_objective_below_zero_has_no_logarithmic_axis() -> None:
    trajectory = run("unicycle_2r_manipulability")
    assert trajectory.objective.min() < 0.0
    made = figures.objective_comparison([trajectory])
    assert [axes.get_yscale() for axes in made.axes] == ["linear"]


def test_an_objective_that_ends_at_zero_is_drawn_to_its_end() -> None:
    trajectory = run("unicycle_2r_position")
    falling = np.geomspace(1.0, 1e-30, len(trajectory))
    falling[-10:] = 0.0
    other = replace(trajectory, resolver="ej", objective=np.geomspace(1.0, 1e-3, len(trajectory)))
    made = figures.objective_comparison([replace(trajectory, objective=falling), other])
    lower = made.axes[1]
    end, _ = lower.get_ylim()
    x, y = lower.get_lines()[0].get_data()
    assert x[-1] == trajectory.t[-1]
    assert np.all(np.isfinite(y))
    assert np.all(y > end)
    check_legible(made)
    texts = [label.get_text() for label in lower.get_yticklabels()]
    assert [text.startswith("≤") for text in texts] == [True] + [False] * (len(texts) - 1)


def test_objective_falls_and_is_enlarged_where_no_curve_is() -> None:
    pair = [run(PAPER[0]), run(PAPER[0], "pg")]
    upper, lower = figures.objective_comparison(pair, zoom=(0.0, 2.0)).axes
    assert (upper.get_yscale(), lower.get_yscale()) == ("linear", "log")
    (inset,) = upper.child_axes
    assert inset.get_xlim() == (0.0, 2.0)
    assert [line.get_label() for line in upper.lines] == ["RG", "PG"]
    rising = replace(pair[0], objective=pair[0].t.copy())
    assert not figures.objective_comparison([rising]).axes[0].child_axes


def test_guide_shows_the_scenarios_gain_or_the_rate_fitted() -> None:
    trajectory = run(PAPER[0], task__0__gain=2.5, duration=4)

    def guide(given: Trajectory, gain: float | None = None) -> str:
        return str(figures.errors(given, gain).axes[-1].lines[-1].get_label())

    assert "K = 2.5 1/s" in guide(trajectory)
    assert "K = 2.5 1/s (fitted)" in guide(replace(trajectory, scenario=None))
    assert "K = 3 1/s" in guide(trajectory, 3.0)
    followed = {"task": {"gain": 2.5}, "plan": {"track": {"gain": 1.5}}}
    assert "K = 1.5 1/s" in guide(replace(trajectory, scenario=followed))
    assert guide(replace(trajectory, resolver="plan")) == "‖e‖"  # planned motions promise no such decay


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-2.5, "−2.5"), (0.25, "0.25"), (1e-4, "10⁻⁴"), (2.5e-7, "2.5·10⁻⁷"), (-3e8, "−3·10⁸")],
)
def test_numbers_at_ticks(value: float, text: str) -> None:
    assert style.number(value) == text


def test_any_robot_can_be_drawn() -> None:
    """A TIAGo of meshes, with a lifting torso and a head beside the arm."""
    robot = load(
        SHARE / "example-robot-data" / "robots" / "tiago_description" / "robots" / "tiago_no_hand.urdf",
        package_dirs=[SHARE],
    )
    trajectory = bare_run_of(robot)
    made = figures.stroboscopic(trajectory)
    assert len(made.axes) == 2  # its head is far above its wheels
    check_legible(figures.overview(trajectory))
    check_legible(figures.inputs(trajectory))


def bare_run_of(robot: Robot) -> Trajectory:
    q0 = robot.q({"arm_2_joint": -0.5, "arm_4_joint": 1.2})
    task = Task(Position("arm_tool_link"), [1.2, 0.4, 0.9])
    return simulate(Controller(robot, task, ProjectedGradient()), q0, 2.0, 0.02)


def test_figures_under_limits_show_every_limit_and_the_scale() -> None:
    limits = {"limits.velocity": {"platform": 0.4, "arm": 0.5}, "limits.acceleration": 2, "limits.wheels": 5}
    limited = Scenario.load("unicycle_3r_position", {"dt": 0.02, "duration": 4, **limits}).run()
    made = figures.limits(limited)
    check_legible(made)
    drawn = [line for axes in made.axes[:-1] for line in axes.lines if len(line.get_xdata()) > 2]
    assert len(drawn) == len(limited.limit_names) == limited.shares.shape[1]
    assert np.abs(limited.shares - 0.5).max() <= 0.5 + 1e-9
    named = [text.get_text() for axes in made.axes for text in axes.get_legend().get_texts()]
    assert [named.count(one) for one in ("limit", "farther than 5 % of the range from both")] == [1, 1]
    assert sum(name.endswith("wheel_joint rate") for name in named) == 2
    check_legible(figures.overview(limited))
    assert any(axes.get_ylabel() == "λ, margin" for axes in figures.overview(limited).axes)
    assert not any(axes.get_ylabel() == "λ, margin" for axes in figures.overview(run(PAPER[0])).axes)


def test_lines_of_small_robots_are_thin(tmp_path: Path) -> None:
    """A column shows the robots of a large circle at a few points: arms and outlines shrink with them."""
    widest = []
    for width in (9.0, 3.4):
        made = figures.stroboscopic(run("unicycle_2r_position"), [0.0, 10.0], width=width)
        links = [one for one in made.axes[0].collections if isinstance(one, LineCollection)]
        widest.append(max(float(one.get_linewidths()[0]) for one in links))
    assert widest[0] == pytest.approx(4.0)
    assert widest[1] < 0.5 * widest[0]


def test_views_of_a_comparison_share_x_where_both_show_it() -> None:
    runs = two(run("unicycle_3r_position", task__0__reference__radius=0.8))
    above, side = figures.comparison(runs).axes[:2]
    assert side.get_xlabel() == above.get_xlabel() == "x [m]"
    for one, other in zip(above.get_position().intervalx, side.get_position().intervalx, strict=True):
        assert one == pytest.approx(other)
    assert above.get_xlim() == pytest.approx(side.get_xlim())
