"""Each feature with each way to run, and each with each other: it runs, or says why it does not.

`PYTHONPATH=. python tests/motion/test_matrix.py` writes the tables of docs/architecture.md anew.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest

import nmm
from nmm.extending import Making, Plugin, Section
from nmm.model.robots.zero_order_hold import HeldInputs
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.setups import ScenarioSetup
from nmm.plugins.sweeps.rows import rows_of

PAGE = Path(__file__).parents[2] / "docs" / "architecture.md"
BEGIN, END = "<!-- matrix -->\n", "<!-- end -->"
DT, DURATION = 0.02, 0.3
HAND = {"kind": "position", "frame": "ee", "axes": "xy", "reference": [2, 1], "gain": 3}
JOINT = {
    "kind": "coordinates", "of": "q1", "reference": [0.8], "priority": 2, "name": "joint",
    "when": {"kind": "between", "start": 0.1, "end": 0.2},
}  # fmt: skip
BALL = {"shape": {"kind": "sphere", "radius": 0.1}, "xyz": [1.4, 0.0, 0.4], "name": "ball"}
END_BALL = {"shape": {"kind": "sphere", "radius": 0.15}, "xyz": [2.0, 1.0, 0.4], "name": "end"}
ALPHA = 0.5
SEEN = {"every": 0.1, "late": 0.04, "start": [0.05, 0.05, 0.05]}

FEATURES: dict[str, dict[str, object]] = {
    "order 2": {"order": 2},
    "tasks that begin and end": {"task": [HAND, JOINT]},
    "distances": {"collisions": {"distance": 0.02, "obstacles": [BALL, END_BALL]}},
    "retreat": {"retreat": {"stalled": 0.04, "progress": 0.3, "durations": [0.04]}},
    "Armijo's rule": {"resolver": {"kind": "pg", "alpha": 200 * ALPHA, "step": "armijo"}},
    "a goal": {"until": {"m": 1.05, "rad": 0.1}},
    "noise": {"disturbances": {"noise": 1e-3, "seed": 1}},
    "delay": {"disturbances": {"delay": 2}},
    "slip": {"disturbances": {"slip": {"v": 0.95}}},
    "a localisation": {"disturbances": {"localisation": SEEN}},
    "Python functions": {"python_hand": True},
}
DISTURB = ("noise", "delay", "slip", "a localisation")


class PythonHand(Section):
    """The hand's position by a Python function, in place of the file's own task of it."""

    summary: ClassVar[str] = "true for a hand whose position a Python function gives"
    after: ClassVar[str] = "objective"

    def tasks(self, making: Making, tasks: list[nmm.Task]) -> list[nmm.Task]:
        def place(at: nmm.Configuration) -> np.ndarray:
            return at.placement("ee").translation[:2]

        def slope(at: nmm.Configuration) -> np.ndarray:
            return at.jacobian("ee")[:2]

        function = nmm.CallableFunction(place, ["x", "y"], units=["m", "m"], jacobian=slope)
        return [nmm.Task(function, tasks[0].reference, tasks[0].gain), *tasks[1:]]


PLUGIN = Plugin("matrix", sections={"python_hand": "test_matrix:PythonHand"})


class Ran(NamedTuple):
    """A run: q (N, n) and u (N, m) at its samples."""

    q: np.ndarray
    u: np.ndarray


@cache
def scenario() -> nmm.Scenario:
    """What has none of FEATURES; its robot is loaded once."""
    keys = {
        "task": [HAND], "q0": {"q2": 0.5}, "dt": DT, "duration": DURATION,
        "objective": {"kind": "quadratic", "terms": [{"of": "q1", "target": 0.7}]},
        "resolver": {"kind": "pg", "alpha": ALPHA},
    }  # fmt: skip
    loaded = nmm.Scenario.load("unicycle_2r_position", keys)
    loaded.robot()
    return loaded


class Case:
    """A scenario with some of FEATURES."""

    def __init__(self, *features: str, method: str = "zoh") -> None:
        self.features = features
        keys: dict[str, Any] = {"disturbances": {}}
        for name in features:
            more = FEATURES[name]
            for key, value in more.items():
                keys[key] = keys[key] | value if key == "disturbances" else value
        self.disturbed = keys["disturbances"]
        if not self.disturbed:
            del keys["disturbances"]
        self.scenario = scenario().with_settings({"method": method} | keys)
        self.robot = self.scenario.robot()
        self.q0 = self.robot.q({"q2": 0.5})
        self.until = self.scenario.parts.goal()

    @property
    def disturbances(self) -> nmm.Disturbances | None:
        if self.localisation is None:
            return nmm.Disturbances(**self.disturbed) if self.disturbed else None
        return nmm.Disturbances(**self.disturbed | {"localisation": self.localisation})

    @property
    def localisation(self) -> nmm.Localisation | None:
        return (
            nmm.Localisation(**self.disturbed["localisation"]) if "localisation" in self.disturbed else None
        )

    def controller(self) -> nmm.Controller:
        return self.scenario.controller()

    def reached(self, controller: nmm.Controller, t: float, q: np.ndarray) -> bool:
        """Whether a loop of one's own is at the goal."""
        return self.until is not None and self.until.reached(controller.evaluate(t, q).error, controller.rows)


def simulate(case: Case) -> Ran:
    method = case.scenario.parts.method
    given = {"until": case.until, "disturbances": case.disturbances}
    run = nmm.simulate(case.controller(), case.q0, DURATION, DT, method, **given)
    assert run.outcome not in ("failed", "singular", "diverged"), str(run.verdict)
    return Ran(run.q, run.u)


def step(case: Case) -> Ran:
    controller, q, found, given = case.controller(), case.q0, [], []
    more: dict[str, Any] = {}
    if case.disturbances is not None:
        more = {"plant": case.disturbances.plant(case.robot, DT)}
    controller.reset()
    for k in range(round(DURATION / DT) + 1):
        found.append(q)
        if case.reached(controller, DT * k, q):
            break
        q, u = controller.step(DT * k, q, DT, "zoh", **more)
        given.append(u)
    return Ran(np.array(found), np.array(given))


def rollout(case: Case) -> Ran:
    given = {"until": case.until, "disturbances": case.disturbances, "keep": ("q", "u")}
    run = nmm.rollout(case.controller(), case.q0, DURATION, DT, "zoh", **given)
    assert run.outcome[0] in ("ended", "reached", "missed"), run.message
    count = int(run.samples[0])
    return Ran(run["q"][0, :count], run["u"][0, :count])


def sweep(case: Case) -> Ran:
    runs: list[nmm.Trajectory] = []
    definition = nmm.Sweep(case.scenario, {"q0.y": [0.0, 0.1]}).definition
    row = rows_of(definition, [0], lambda _, run: runs.append(run))[0]
    if not runs:
        raise nmm.InputError(row["message"])
    return Ran(runs[0].q, runs[0].u)


def drive(case: Case) -> Ran:
    driven = Driven(ScenarioSetup(case.scenario))
    for key, value in DRIVE_CHOICES.items():
        if key in {choice.key for choice in driven.choices} & {*case.features}:
            driven.use(driven.with_choice(key, value))
    found, given = [driven.q], []
    for _ in range(round(DURATION / DT)):
        driven.look()
        if not driven.step():
            raise nmm.RunError(driven.trouble)
        found.append(driven.q)
        given.append(driven.u)
    return Ran(np.array(found), np.array(given))


#: What a page has to choose before the feature is in use.
DRIVE_CHOICES = {"retreat": True}


def loop(case: Case) -> Ran:
    """A robot's loop on a robot of one's own: what is measured of it and what its drives make is ours."""
    controller, q, found, given = case.controller(), case.q0, [], []
    loop = nmm.Loop(controller, DT, soft_start=0.0)
    count, n = round(DURATION / DT) + 1, case.robot.n
    noise = np.random.default_rng([case.disturbed.get("seed", 0), 0]).standard_normal((count, n))
    slip = [case.disturbed.get("slip", {}).get(name, 1.0) for name in case.robot.u_names]
    late, hold = case.disturbed.get("delay", 0), HeldInputs(case.robot)
    sensors = case.localisation
    believing = None if sensors is None else sensors.on(case.robot, DT, (case.disturbed.get("seed", 0), 0, 1))
    pose = q[:3] if believing is None else believing.begin(q)
    for k in range(count):
        found.append(q)
        measured = np.concatenate([q[:3] if believing is None else pose, q[3:]])
        given.append(loop.step(DT * k, measured + case.disturbed.get("noise", 0.0) * noise[k]))
        assert str(loop.state) == "running", loop.findings
        if case.reached(controller, DT * k, q):
            break
        acting = given[k - late] if k >= late else np.zeros(case.robot.n_u)
        before, q = q, hold(q, slip * acting, DT)
        if believing is not None:
            pose = believing.go_on(before, q, DT * acting[: case.robot.platform.p], DT)
    assert len(loop.trajectory()) == len(found)
    return Ran(np.array(found), np.array(given))


def horizon(case: Case) -> Ran:
    controller = case.controller()
    for name, parameter in (("retreat", "retreat"), ("Armijo's rule", "resolver")):
        if name in case.features and parameter not in inspect.signature(nmm.Horizon).parameters:
            raise nmm.InputError("a horizon looks for whole motions, and has no resolver", where="Horizon")
    task = next((task for task in controller.given.task if task.when), controller.given.task.tasks[0])
    limits = nmm.Limits({"v": 1.0, "omega": 1.0, "arm": 1.0}, acceleration=3.0)
    look = {"dt": 0.1, "ahead": 1.0, "samples": 10}
    ahead = nmm.Horizon(case.robot, task, controller.given.collisions, limits, **look)
    more = {} if case.disturbances is None else {"disturbances": case.disturbances}
    run = ahead.run(case.q0, 8.0 * DURATION, case.until, **more)
    return Ran(run.q, run.u)


WAYS: dict[str, Callable[[Case], Ran]] = {
    "simulate": simulate,
    "controller.step": step,
    "rollout": rollout,
    "sweep": sweep,
    "drive": drive,
    "Loop": loop,
    "Horizon": horizon,
}
#: What a way does with a feature where that is no other motion than without it.
SAME = {
    ("a goal", "drive"): "a driven robot waits at its target for the next",
    ("order 2", "Horizon"): "its inputs always accelerate",
}
#: The largest difference of q from that of `simulate`, m and rad: 0 where both are the same calls.
CLOSE = {"controller.step": 1e-12, "rollout": 0.0, "sweep": 0.0, "drive": 1e-12, "Loop": 1e-9}
#: The same at order 2. Differences over 1e-6 s make more of rounding, and a robot's drives hold the inputs of
#: a period's end while those of `simulate` rise.
SECOND = {"controller.step": 1e-10, "drive": 1e-10, "Loop": 0.02}


@cache
def attempt(way: str, *features: str, method: str = "zoh") -> Ran | str:
    """The run, or why there is none."""
    try:
        return WAYS[way](Case(*features, method=method))
    except nmm.NmmError as error:
        return re.sub(r"^\S*\.yaml: (set )?", "", str(error))
    except TypeError as error:  # a parameter that it does not have
        return f"it has no such parameter: {error}"
    except AttributeError as error:
        return f"it has no such name: {error}"


def driven_method(*features: str) -> str:
    """The method by which a page drives: inputs are held where a robot does not do as it is told."""
    return "zoh" if {*DISTURB} & {*features} else "rk4"


def other(ran: Ran, plain: Ran) -> bool:
    return len(ran.q) != len(plain.q) or bool(np.abs(ran.q - plain.q).max() > 1e-7)


def agrees(way: str, *features: str) -> bool:
    """Whether the robot moves as by `simulate`, with the same features and method."""
    ran = attempt(way, *features)
    reference = attempt("simulate", *features, method=driven_method(*features) if way == "drive" else "zoh")
    assert isinstance(ran, Ran)
    assert isinstance(reference, Ran)
    count = min(len(ran.q), len(reference.q))
    close = (SECOND if "order 2" in features else CLOSE).get(way, CLOSE[way])
    off = np.abs(ran.q[:count] - reference.q[:count]).max()
    return abs(len(ran.q) - len(reference.q)) <= 1 and bool(off <= close)


def has_effect(feature: str, ran: Ran, plain: Ran, way: str = "") -> bool:
    if feature == "Python functions":
        return not other(ran, plain)
    if (feature, way) in SAME:
        return np.array_equal(ran.q, plain.q)
    return other(ran, plain)


class Cell(NamedTuple):
    runs: bool
    why: str


def of_way(feature: str, way: str) -> Cell:
    """A feature with a way to run."""
    ran, plain = attempt(way, feature), attempt(way)
    assert isinstance(plain, Ran), plain
    if isinstance(ran, str):
        return Cell(False, ran)
    if not has_effect(feature, ran, plain, way):
        return Cell(False, "it is left aside, and nothing says so")
    if way in CLOSE and (feature, way) not in SAME and not agrees(way, feature):
        return Cell(False, "the robot moves otherwise than by `simulate`")
    return Cell(True, "")


def of_pair(first: str, second: str) -> Cell:
    """Two features in one `simulate`: neither is left aside beside the other."""
    ran = attempt("simulate", first, second)
    if isinstance(ran, str):
        return Cell(False, ran)
    for feature, rest in ((first, second), (second, first)):
        plain = attempt("simulate", rest)
        assert isinstance(plain, Ran), plain
        if not has_effect(feature, ran, plain):
            return Cell(False, f"{feature}: it is left aside, and nothing says so")
    return Cell(True, "")


PAIRS = list(combinations(FEATURES, 2))
CELLS = [(feature, way) for feature in FEATURES for way in WAYS]


@pytest.fixture(scope="module", autouse=True)
def _plugin() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("nmm.base.plugins._foreign_plugins", lambda: (PLUGIN,))
        yield


@pytest.mark.parametrize("way", CLOSE)
def test_a_way_moves_the_robot_as_simulate_does(way: str) -> None:
    assert agrees(way)


@pytest.mark.parametrize(("feature", "way"), CELLS)
def test_a_cell_runs_or_says_why(feature: str, way: str) -> None:
    cell = of_way(feature, way)
    assert cell == expected()[feature, way]


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_two_features_go_together_or_say_why(first: str, second: str) -> None:
    assert of_pair(first, second) == expected()[first, second]


def test_the_page_has_these_tables() -> None:
    assert in_page() == tables()


@cache
def expected() -> dict[tuple[str, str], Cell]:
    """The cells as docs/architecture.md has them."""
    reasons, cells = {}, {}
    lines = in_page().splitlines()
    for line in lines:
        if line[:1].isdigit():
            number, _, reason = line.partition(". ")
            reasons[number] = reason
    head: list[str] = []
    for line in lines:
        if not line.startswith("|") or line.startswith("|---"):
            continue
        first, *rest = (part.strip() for part in line.strip("|").split("|"))
        if not first:
            head = rest
            continue
        for name, text in zip(head, rest, strict=True):
            cells[first, name] = Cell(text == "+", reasons.get(text.strip("()"), ""))
    return cells


def in_page() -> str:
    return PAGE.read_text("utf-8").partition(BEGIN)[2].partition(END)[0]


def tables() -> str:
    """Both tables, and the reasons of what is refused."""
    reasons: list[str] = []

    def sign(cell: Cell) -> str:
        if cell.runs:
            return "+"
        if cell.why not in reasons:
            reasons.append(cell.why)
        return f"({reasons.index(cell.why) + 1})"

    lines = [f"| | {' | '.join(WAYS)} |", "|---" * (len(WAYS) + 1) + "|"]
    for feature in FEATURES:
        lines.append(f"| {feature} | {' | '.join(sign(of_way(feature, way)) for way in WAYS)} |")
    names = list(FEATURES)
    lines += ["", f"| | {' | '.join(names[1:])} |", "|---" * len(names) + "|"]
    for first in names[:-1]:
        pairs = [sign(of_pair(first, name)) if (first, name) in PAIRS else "" for name in names[1:]]
        lines.append(f"| {first} | {' | '.join(pairs)} |")
    return "\n".join([*lines, "", *(f"{i}. {why}" for i, why in enumerate(reasons, 1)), ""])


if __name__ == "__main__":
    import nmm.base.plugins

    nmm.base.plugins._foreign_plugins = lambda: (PLUGIN,)  # type: ignore[assignment]  # as the fixture does
    sys.modules["test_matrix"] = sys.modules["__main__"]
    text = PAGE.read_text("utf-8")
    before, _, after = text.partition(BEGIN)
    PAGE.write_text(before + BEGIN + tables() + END + after.partition(END)[2], "utf-8")
