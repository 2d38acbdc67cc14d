"""What descriptions by wheels lead to: mobility, repeated and contradictory wheels, errors."""

from __future__ import annotations

import copy
import math
import pickle
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from findings import refused
from numpy import pi
from places import ROOT
from wheeled_examples import (
    AXLE,
    CASTER,
    EXAMPLES,
    FRONT,
    RAKED,
    TRIANGLE,
    TWO_STEERED,
    corners,
    random_path,
    trailer,
)

from nmm.base.errors import NOTHING
from nmm.model.platforms.wheeled.descriptions import CasterWheel, FixedWheel, Hitch, OmniWheel, SteeredWheel
from nmm.model.platforms.wheeled.inputs import CommonSpeed, WeightedSpins, WheelSpeed, WheelSpin
from nmm.model.platforms.wheeled.platform import WheeledPlatform


@pytest.mark.parametrize(
    ("wheels", "found"),
    [
        (TRIANGLE, (3, 0)),
        ([CASTER], (3, 0)),
        ([SteeredWheel("wheel", 0.2, 0.1, 0.1, trail=0.05)], (3, 0)),
        (AXLE, (2, 0)),
        ([*AXLE, SteeredWheel("wheel", 0.2, 0.1, 0.1, trail=0.05)], (2, 0)),
        ([SteeredWheel("wheel", 0.2, 0.1, 0.1), CASTER], (2, 1)),
        ([*AXLE, FRONT], (1, 1)),
        (TWO_STEERED, (1, 2)),
        (corners(), (1, 2)),
        ([*corners()[:3], RAKED], (1, 2)),
        ([*EXAMPLES["stuck"].wheels, FRONT, *corners(trail=0.1)[:2]], (0, 1)),
    ],
)
def test_the_five_types_of_mobility(wheels: list[Any], found: tuple[int, int]) -> None:
    platform = WheeledPlatform(wheels)
    assert (platform.mobility, platform.steerability) == found
    assert platform.p == sum(found)


def test_wheels_with_a_trail_do_not_say_what_v_is(rng: np.random.Generator) -> None:
    wheel = SteeredWheel("wheel", 0.2, 0.1, 0.1, joint="s")
    platform = WheeledPlatform([RAKED, wheel])
    assert platform.inputs == ("v", "omega", "s_rate")
    rates = platform.wheel_rates(rng.uniform(-1, 1, 5), [0.7, 0.2, 0.3])
    assert rates["wheel"].spin == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("name", "inputs"),
    [
        ("raked front wheel", "v omega"),
        ("steered raked front wheel", "v steering_rate"),
        ("driven casters", "vx vy omega"),
        ("axles and a driven caster", "v omega"),
        ("car with a steered trailer", "v steering_rate t_steering_rate"),
        ("two front wheels", "v steer_front_left_rate"),
        ("four steered", "v steer_front_left_rate steer_rear_left_rate"),
        ("hitch with nothing", "v omega h_rate"),
        ("straight on", "v"),
        ("about a point", "omega"),
    ],
)
def test_inputs_by_default(name: str, inputs: str) -> None:
    assert " ".join(EXAMPLES[name].inputs) == inputs


def test_wheels_that_repeat_others_add_nothing(rng: np.random.Generator) -> None:
    qp = rng.uniform(-1, 1, 4)
    wheels = [*AXLE, FRONT, FixedWheel("third", 0, 0.5, 0.2, pi), FixedWheel("fourth", 0, 0.1, 0.3)]
    twin = SteeredWheel("twin", 0.8, 0, 0.12, joint="steering", offset=0.1)
    for more in ([], [twin], [CASTER, OmniWheel("omni", 0.2, 0.2, 0.1)]):
        platform = WheeledPlatform([*wheels, *more], inputs=[WheelSpin("rear_left"), "steering_rate"])
        expected = WheeledPlatform([*AXLE, FRONT], inputs=[WheelSpin("rear_left"), "steering_rate"])
        np.testing.assert_allclose(platform.G(qp), expected.G(qp), atol=1e-14)


@pytest.mark.parametrize("name", ["four steered", "two front wheels"])
def test_wheels_that_contradict_each_other_are_named(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    qp = random_path(name, rng)(0.0)
    assert platform.problem(qp) is None
    qp[-1] += 1e-2
    problem = platform.problem(qp)
    assert problem is not None
    first = "rear_left, rear_right, front_left" if name == "two front wheels" else "front_left, rear_left"
    last = "front_right" if name == "two front wheels" else "rear_right"
    assert problem.startswith(
        f"the axes of wheels {first} and {last} do not meet in one point: {last} would slip"
    )
    assert f"steer_{last} = {math.degrees(qp[-1]):.6g} deg" in problem
    assert np.all(np.isnan(platform.G(qp)))


def test_axes_stay_concurrent_over_a_run() -> None:
    """Four steered wheels, by Runge and Kutta's method: two follow to the integrator's order."""
    platform, qp, worst = EXAMPLES["four steered"], np.zeros(7), []
    for steps in (100, 200):
        qp, h = np.zeros(7), 4.0 / steps
        slip = 0.0
        for k in range(steps):
            stages = [np.zeros(7)]
            for share in (0, 0.5, 0.5, 1):
                t = (k + share) * h
                up = [0.5, 0.6 * math.cos(1.5 * t), -0.5 * math.cos(t)]
                stages.append(platform.G(qp + share * h * stages[-1]) @ up)
            qp = qp + h / 6 * (stages[1] + 2 * stages[2] + 2 * stages[3] + stages[4])
            slip = max(slip, *(f.row.share(qp) for f in platform._structure.followed))
        worst.append(slip)
    assert worst[1] < 1e-7
    assert worst[0] / worst[1] == pytest.approx(16, rel=0.5)


@pytest.mark.parametrize(
    ("name", "qp", "said"),
    [
        (
            "car",
            [0, 0, 1, pi / 2],
            "here v does not determine the motion, because of front (steering = 90 deg)",
        ),
        ("trailers", [0, 0, 1, 2, 3], None),
        ("front drive", [0, 0, 1, pi / 2], None),
        (
            "two steered",
            [0, 0, 1, *2 * [math.atan2(0.3, 0.9) + pi / 2]],
            "wheels a and b are not independent here",
        ),
    ],
)
def test_singular_configurations_are_explained(name: str, qp: list[float], said: str | None) -> None:
    problem = EXAMPLES[name].problem(qp)
    assert np.all(np.isfinite(EXAMPLES[name].G(qp))) == (said is None)
    assert problem is None if said is None else said in str(problem)


@pytest.mark.parametrize("name", ["trailers", "four steered", "mecanum"])
def test_copies_travel(name: str, rng: np.random.Generator) -> None:
    qp = random_path(name, rng)(0.0)
    for twin in (copy.deepcopy(EXAMPLES[name]), pickle.loads(pickle.dumps(EXAMPLES[name]))):
        np.testing.assert_array_equal(twin.G(qp), EXAMPLES[name].G(qp))
        np.testing.assert_array_equal(twin.A(qp), EXAMPLES[name].A(qp))
        assert twin.inputs == EXAMPLES[name].inputs


def test_the_pages_examples_are_what_they_say() -> None:
    page = ROOT / "docs" / "platforms.md"
    text = page.read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    found: dict[str, Any] = {}
    exec(code, found)
    said = dict(re.findall(r"(\w+) = WheeledPlatform[^#]*# (.*)", code))
    assert said.pop("differential") == "rad/s"
    assert {name: ", ".join(found[name].inputs) for name in said} == said
    assert found["differential"].input_units == ("rad/s", "rad/s")
    assert set(found["rates"]) == {"left", "right", "front"}


# Bad descriptions.

HITCH = Hitch("h", -0.2)
UNCHECKED = object()


@pytest.mark.parametrize(
    ("make", "where", "got"),
    [
        (lambda: FixedWheel("w", 0, 0, 0.0), "wheel w: radius", 0.0),
        (lambda: FixedWheel("w", 0, 0, -0.1), "wheel w: radius", -0.1),
        (lambda: FixedWheel("w", math.nan, 0, 0.1), "wheel w: x", math.nan),
        (lambda: FixedWheel("", 0, 0, 0.1), "wheel", ""),
        (lambda: CasterWheel("c", 0, 0, 0.1), "wheel c: trail", 0.0),
        (lambda: OmniWheel("o", 0, 0, 0.1, roller=pi / 2), "wheel o: roller", 1.5707963267948966),
        (lambda: OmniWheel("o", 0, 0, 0.1, roller=-pi / 2), "wheel o: roller", -1.5707963267948966),
        (lambda: SteeredWheel("s", 0, 0, 0.1, lower=1.0, upper=-1.0), "wheel s", (1.0, -1.0)),
        (lambda: Hitch("h", 0, upper=math.nan), "hitch h", (-math.inf, math.nan)),
        (lambda: Hitch("h", math.inf), "hitch h: x", math.inf),
        (lambda: WeightedSpins({}), "input drive", UNCHECKED),
        (lambda: WeightedSpins({"a": "much"}), "input drive: weight of a", "much"),
        (
            lambda: WheeledPlatform([*AXLE, AXLE[0]]),
            "wheel rear_left",
            ("rear_left", "rear_right", "rear_left"),
        ),
        (lambda: WheeledPlatform(AXLE, [HITCH, HITCH]), "joint h", NOTHING),
        (lambda: WheeledPlatform(AXLE, [Hitch("x", 0)]), "joint x", NOTHING),
        (lambda: WheeledPlatform(AXLE, [Hitch("h", 0, carrier="g")]), "hitch h", "g"),
        (
            lambda: WheeledPlatform(AXLE, [Hitch("h", 0, carrier="g"), Hitch("g", 0, carrier="h")]),
            "hitches h, g",
            NOTHING,
        ),
        (lambda: WheeledPlatform(trailer("t", "h", 1)), "wheel t_left", "h"),
        (lambda: WheeledPlatform([FRONT, SteeredWheel("other", 0.5, 0, 0.1)]), "joint steering", NOTHING),
        (lambda: WheeledPlatform(["wheel"]), "wheeled", "wheel"),
        (lambda: WheeledPlatform(AXLE, inputs=["w"]), "inputs", "w"),
        (lambda: WheeledPlatform(AXLE, inputs=[WheelSpin("left")]), "input WheelSpin", "left"),
        (lambda: WheeledPlatform(AXLE, inputs=[3]), "inputs", 3),
        (lambda: WheeledPlatform([*AXLE, CASTER], inputs=[WheelSpin("caster")]), "wheel caster", NOTHING),
        (lambda: WheeledPlatform(AXLE, inputs=["v"]), "inputs", ("v",)),
        (lambda: WheeledPlatform(AXLE, inputs=["v", "vx"]), "input vx", NOTHING),
        (lambda: WheeledPlatform(AXLE, inputs=["v", "omega", "omega"]), "input omega", NOTHING),
        (lambda: WheeledPlatform(AXLE, inputs=["vy", "v"]), "input vy", NOTHING),
        (
            lambda: WheeledPlatform(
                AXLE, inputs=[WheelSpeed("rear_left", "a"), WheelSpeed("rear_right", "a")]
            ),
            "input a",
            ("a", "a"),
        ),
        (lambda: WheeledPlatform([FRONT], inputs=["vx", "vy", "omega"]), "wheel front", NOTHING),
        (lambda: WheeledPlatform(TWO_STEERED, inputs=[CommonSpeed("a", "a")]), "CommonSpeed", ("a", "a")),
        (
            lambda: WheeledPlatform([*AXLE, CASTER], inputs=[CommonSpeed("caster", "rear_left")]),
            "CommonSpeed",
            "caster",
        ),
        (
            lambda: WheeledPlatform([*AXLE, RAKED], inputs=[CommonSpeed("rear_left", "front")]),
            "CommonSpeed",
            "front",
        ),
        (
            lambda: WheeledPlatform([*AXLE, RAKED], inputs=["v", "omega", "steering_rate"]),
            "wheel front",
            NOTHING,
        ),
        (
            lambda: WheeledPlatform(
                [*AXLE, FRONT, *trailer("t", "h", 0.5), SteeredWheel("s", -0.9, 0, 0.1, joint="s", body="h")],
                [HITCH],
            ),
            "wheel s",
            NOTHING,
        ),
        (lambda: WheeledPlatform(AXLE, limits={"w": 1.0}), "limits of platform wheeled", "w"),
        (lambda: EXAMPLES["axle"].wheel_rates([0, 0, 0], [1, 1], {"rear_left": 0.0}), "swivels", "rear_left"),
        (lambda: EXAMPLES["car"].wheel_rates([0, 0, 0, pi / 2], [1, 1]), "wheeled", NOTHING),
    ],
)
def test_bad_descriptions_are_refused(make: Callable[[], Any], where: str, got: object) -> None:
    with refused(where) as caught:
        make()
    if got is not UNCHECKED:
        np.testing.assert_array_equal(caught.value.got, got)


def test_limits_and_rollers() -> None:
    wheels = [*AXLE, SteeredWheel("front", 0.8, 0, 0.1, lower=-0.6, upper=0.7), *trailer("t", "h", 0.5)]
    platform = WheeledPlatform(wheels, [Hitch("h", -0.1, lower=-1.5, upper=1.0)], limits={"v": 2})
    np.testing.assert_array_equal(platform.input_limits, [2.0, np.inf])
    np.testing.assert_array_equal(platform.coordinate_limits[3:], [[-0.6, 0.7], [-1.5, 1.0]])
    assert np.all(np.isinf(platform.coordinate_limits[:3]))
    assert platform.problem([0, 0, 9, 0, 1.0]) is None
    assert (
        platform.problem([0, 0, 9, 0, 1.2]) == "h is folded to 68.75 deg, beyond its limits -85.94 and 57.3"
    )
    mecanum = EXAMPLES["mecanum"]
    assert mecanum.roller(0.25, 0.2) == mecanum.roller(-0.3, -0.1) == -pi / 4
    assert mecanum.roller(-0.25, 0.2) == pi / 4
    assert platform.roller(0.0, 0.3) == 0.0
