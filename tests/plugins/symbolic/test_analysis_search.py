"""Search of singular configurations: known families, none where there is none, and the nearest one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import twin
from numpy import cos, pi, sin
from numpy.typing import NDArray
from urdf_parts import AXIS, joint, link, robot, write

from nmm.analysis import analyse
from nmm.base.errors import InputError, SingularError
from nmm.control.functions.tasks import CallableFunction, Heading, Pose, Position, Posture
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic.search.family import SingularFamily
from nmm.plugins.symbolic.search.many_starts import SingularitySearch, find_singularities
from nmm.plugins.symbolic.search.nearest import nearest_singularity
from nmm.scenario import Scenario

Array = NDArray[np.float64]

XY, XYZ = Position("ee", "xy"), Position("ee", "xyz")
#: sin and cos vanish there; the lists of values are those without doubles, ±π being one.
OF_SIN, OF_COS = [0.0, pi], [-pi / 2, pi / 2]


@pytest.fixture(scope="module")
def planar() -> Robot:
    """A 2R arm on a base that does not move."""
    return load("unicycle_2r", platform="fixed")


def pinned(family: SingularFamily) -> dict[str, list[float]]:
    return {name: sorted(round(value, 4) for value in values) for name, values in family.pinned.items()}


def near(**values: list[float]) -> dict[str, list[float]]:
    return {name: sorted(round(value, 4) for value in of) for name, of in values.items()}


def by_pinned(search: SingularitySearch) -> dict[frozenset[str], SingularFamily]:
    return {frozenset(family.pinned): family for family in search.families}


def smallest_on_a_grid(sigma: Callable[[float, float], float]) -> float:
    """Minimum over two angles, by a grid that closes in three times on its best point."""
    center, width = np.zeros(2), pi
    for _ in range(4):
        a, b = (np.linspace(middle - width, middle + width, 61) for middle in center)
        values = np.array([[sigma(one, two) for two in b] for one in a])
        i, j = np.unravel_index(np.argmin(values), values.shape)
        center, width = np.array([a[i], b[j]]), width / 20
    return float(values.min())


@pytest.mark.parametrize("task", ["position", "pointing"])
def test_the_papers_robot_has_none(task: str, robot_2r: Robot) -> None:
    twins = twin.Planar()
    tasks, J = (XY, twins.J) if task == "position" else ([XY, Heading("link2")], twins.J_pointing)
    search = find_singularities((robot_2r, tasks), starts=60)
    assert not search.found
    assert not search.families
    assert search.converged == 0
    assert search.indifferent == ("x", "y", "theta")
    expected = smallest_on_a_grid(lambda a, b: np.linalg.svd(J(np.array([0, 0, 0, a, b])))[1][-1])
    assert search.smallest is not None
    assert search.smallest.sigma_min == pytest.approx(expected, rel=1e-6)
    assert np.linalg.svd(J(search.smallest.q))[1][-1] == pytest.approx(expected, rel=1e-6)
    assert "found from 60 starts" in search.text()
    assert nearest_singularity((robot_2r, tasks), np.ones(5), starts=20) is None


@pytest.mark.thorough
def test_link_pointing_has_none_even_around_the_target() -> None:
    """There J_bar is infinite where the elbow meets the target: no rank is lost by that."""
    controller = Scenario.load("unicycle_2r_link_pointing").controller()
    search = find_singularities(controller, starts=60, ranges={"x": (5.0, 7.0), "y": (1.0, 3.0)})
    assert not search.found
    assert set(search.ranges) == {"x", "y", "theta", "q1", "q2"}


def test_without_offset(rng: np.random.Generator) -> None:
    robot, twins = load("unicycle_2r", arguments={"d": 0.0}), twin.Planar(d=0.0)
    (family,) = find_singularities((robot, XY), starts=60).families
    assert pinned(family) == near(q1=OF_COS, q2=OF_SIN)
    assert (family.free, family.dimension, family.rank) == (("x", "y", "theta"), 3, 1)
    for q in family.examples:
        np.testing.assert_allclose(list(twins.minors(q).values()), 0.0, atol=1e-8)
    (family,) = find_singularities((robot, [XY, Heading("link2")]), starts=60).families
    assert pinned(family) == near(q1=OF_COS)
    assert (family.free, family.dimension) == (("x", "y", "theta", "q2"), 4)
    for a in OF_COS:
        q = np.array([*rng.uniform(-3, 3, 3), a, rng.uniform(-3, 3)])
        np.testing.assert_allclose(list(twins.minors_pointing(q).values()), 0.0, atol=1e-12)


def test_the_3r_is_singular_when_it_is_vertical(robot_3r: Robot) -> None:
    search = find_singularities((robot_3r, XYZ), starts=80)
    (family,) = search.families
    assert pinned(family) == near(q2=OF_SIN, q3=OF_SIN)
    assert (family.free, family.rank) == (("x", "y", "theta", "q1"), 2)
    assert family.lost == ("ee.z",)
    assert "q2 = 0 or ±π; q3 = 0 or ±π" in search.text()
    arm = find_singularities((robot_3r, XYZ), starts=80, part="arm")
    kinds = by_pinned(arm)
    assert set(kinds) == {frozenset({"q3"}), frozenset()}
    assert pinned(kinds[frozenset({"q3"})]) == near(q3=OF_SIN)
    over = kinds[frozenset()]  # the tip is on the axis of q1: Λ = 0
    assert over.related == ("q2", "q3")
    for q in over.examples:
        assert 0.5 * sin(q[4]) + 0.4 * sin(q[4] + q[5]) == pytest.approx(0.0, abs=1e-7)


def test_the_3r_without_offset() -> None:
    """By the minors with d = 0: s2 = s3 = 0, or c1 = s3 = 0, or s1 = Λ = 0."""
    robot, twins = load("unicycle_3r", arguments={"d": 0.0}), twin.Elbow(d=0.0)
    kinds = by_pinned(find_singularities((robot, XYZ), starts=150))
    assert set(kinds) == {frozenset({"q2", "q3"}), frozenset({"q1", "q3"}), frozenset({"q1"})}
    assert pinned(kinds[frozenset({"q2", "q3"})]) == near(q2=OF_SIN, q3=OF_SIN)
    assert pinned(kinds[frozenset({"q1", "q3"})]) == near(q1=OF_COS, q3=OF_SIN)
    assert pinned(kinds[frozenset({"q1"})]) == near(q1=OF_SIN)
    assert kinds[frozenset({"q1"})].related == ("q2", "q3")
    for family in kinds.values():
        for q in family.examples:
            np.testing.assert_allclose(list(twins.minors(q).values()), 0.0, atol=1e-7)


def test_a_planar_2r(planar: Robot) -> None:
    search = find_singularities((planar, XY), starts=40)
    (family,) = search.families
    assert pinned(family) == near(q2=OF_SIN)
    assert "q1" in family.free
    assert "q1" in search.indifferent
    assert family.conditions == "q2 = 0 or ±π"
    assert family.lost == ("ee.x",)
    assert search.smallest is None


def test_none_where_there_is_none(robot_2r: Robot) -> None:
    base = load("omni_base")
    for subject in ((robot_2r, Posture()), (base, Position("base_footprint", "xy"))):
        search = find_singularities(subject, starts=10)
        assert not search.found
        assert search.smallest is not None
        assert search.smallest.ratio > 0.01
        assert nearest_singularity(subject, np.zeros(subject[0].n), starts=5) is None


def test_singular_everywhere(robot_2r: Robot) -> None:
    for axes, rank in (("z", 0), ("xyz", 2)):
        search = find_singularities((robot_2r, Position("ee", axes)), starts=10)
        assert search.everywhere
        assert search.families[0].rank == rank
        assert search.families[0].free == robot_2r.q_names
        point = nearest_singularity((robot_2r, Position("ee", axes)), np.ones(5), starts=5)
        assert point is not None
        assert point.distance == 0.0
        assert point.summary.startswith("singular already")


def made(slope: Callable[[float, float], float]) -> CallableFunction:
    """A task whose J is diag(1, slope(q1, q2)), in the two joints."""

    def jacobian(configuration: Any) -> Array:
        q = configuration.q
        J = np.zeros((2, len(q)))
        J[0, 0], J[1, 1] = 1.0, slope(q[0], q[1])
        return J

    return CallableFunction(lambda configuration: np.zeros(2), ["a", "b"], jacobian=jacobian)


@pytest.mark.parametrize(
    ("slope", "conditions"),
    [
        (lambda a, b: sin(b) ** 2, {"q2 = 0 or ±π"}),  # touches zero
        (lambda a, b: sin(a) ** 2 + cos(b) ** 2, {"q1 = 0 or ±π; q2 = ±π/2"}),  # in points
        (lambda a, b: cos(a + b), {"q1 + q2 = ±π/2"}),
        (lambda a, b: sin(a) * cos(a - b), {"q1 = 0 or ±π", "q1 - q2 = ±π/2"}),  # pieces that meet
        (lambda a, b: sin(a) - 0.5 * b, {"q1 and q2 tied by an equation"}),
        (lambda a, b: 1 - cos(a - b) + sin(b) ** 2, {"q1 = 0; q2 = 0", "q1 = ±π; q2 = ±π"}),
        (lambda a, b: b - 1.25, {"q2 = 1.25 rad (71.62°)"}),
        (lambda a, b: 1.0 + sin(b) ** 2 * (np.nan if a < 0.0 else 1.0), set()),  # without a J in half of it
        (lambda a, b: sin(b) * (np.nan if a < 0.0 else 1.0), {"q2 = 0 or ±π"}),
    ],
)
def test_sets_of_all_shapes(
    slope: Callable[[float, float], float], conditions: set[str], planar: Robot
) -> None:
    search = find_singularities((planar, made(slope)), starts=20, among=["q1", "q2"])
    assert {family.conditions for family in search.families} == conditions
    for family in search.families:
        for q in family.examples:
            assert abs(slope(q[0], q[1])) < 1e-7


def test_ranges_and_what_does_not_move(planar: Robot) -> None:
    subject = (planar, made(lambda a, b: sin(b) * cos(a)))
    (family,) = find_singularities(subject, starts=20, among=["q1"], at={"q2": 0.3}).families
    assert pinned(family) == near(q1=OF_COS)
    assert (family.dimension, family.moving) == (0, 1)
    assert family.examples[0][planar.coordinate("q2")] == 0.3
    assert find_singularities(subject, starts=20, among=["q1"], at={"q2": pi}).everywhere
    within = {"q1": (0.2, 1.0), "q2": (-1.0, 2.0)}
    search = find_singularities(subject, starts=20, ranges=within)
    (family,) = search.families
    assert pinned(family) == near(q2=[0.0])
    assert {name: search.ranges[name] for name in within} == within
    assert not find_singularities(subject, starts=20, ranges={"q1": (0.2, 1.0), "q2": (0.5, 2.0)}).found
    with pytest.raises(SingularError, match="everywhere in these ranges"):
        find_singularities((planar, made(lambda a, b: np.nan)), starts=5)


def test_examples_are_singular_though_the_ranges_go_beyond_the_limits(tmp_path: Path) -> None:
    hinge = AXIS + '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
    ahead = '<origin xyz="0.5 0 0"/>'
    joints = [
        joint("q1", "base", "upper", body=hinge, origin=""),
        joint("q2", "upper", "fore", body=hinge, origin=ahead),
        joint("tip", "fore", "ee", "fixed", "", ahead),
    ]
    links = [link(name) for name in ("base", "upper", "fore", "ee")]
    arm = load(write(tmp_path / "arm.urdf", robot(*links, *joints)), platform="fixed")
    task = (arm, Position("ee", "xy"))
    (family,) = find_singularities(task, starts=40, ranges={"q2": (-pi, pi)}).families
    assert pinned(family) == near(q2=OF_SIN)
    for example in family.examples:
        assert analyse(task, example).rank == 1
    (inside,) = find_singularities(task, starts=40).families
    assert pinned(inside) == near(q2=[0.0])


def test_the_same_seed_the_same_result(robot_3r: Robot, planar: Robot) -> None:
    fractions: list[float] = []
    one, two = (
        find_singularities((robot_3r, XYZ), starts=20, seed=5, progress=fractions.append) for _ in range(2)
    )
    assert one.text() == two.text()
    assert all(
        np.array_equal(a.examples, b.examples) for a, b in zip(one.families, two.families, strict=True)
    )
    assert fractions[-1] == 1.0
    assert all(0.0 < fraction <= 1.0 for fraction in fractions)
    points = [nearest_singularity((robot_3r, XYZ), np.full(6, 0.5), starts=10, seed=3) for _ in range(2)]
    assert points[0] is not None
    assert points[1] is not None
    assert np.array_equal(points[0].q, points[1].q)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"starts": 0}, "starts: expected a whole number above 0, got 0"),
        ({"starts": 2.5}, "starts: expected a whole number"),
        ({"seed": -1}, "seed: expected a whole number"),
        ({"ranges": {"q2": (1.0, 1.0)}}, r"range of q2: expected \(lower, upper\), got \(1, 1\)"),
        ({"ranges": {"q2": (2.0, 1.0)}}, "range of q2"),
        ({"ranges": {"q7": (0.0, 1.0)}}, "unknown coordinate 'q7'"),
        ({"ranges": {"q2": (0.0, 1.0)}, "among": ["q1"]}, "q2 may not move; among are q1"),
        ({"among": ["q1", "v"]}, "unknown coordinate 'v'"),
        ({"among": []}, "among: expected coordinates"),
        ({"part": "leg"}, "unknown part 'leg'.*available: platform, arm, robot"),
        ({"tolerance": 0.0}, "tolerance: expected a number above 0"),
        ({"length": -1.0}, "length: expected a number above 0"),
    ],
)
def test_bad_input(wrong: dict[str, Any], message: str, robot_2r: Robot) -> None:
    with pytest.raises(InputError, match=message):
        find_singularities((robot_2r, XY), **{"starts": 5, **wrong})
    with pytest.raises(InputError, match=message):
        nearest_singularity((robot_2r, XY), np.zeros(5), **{"starts": 5, **wrong})


def test_bad_subjects(robot_2r: Robot, planar: Robot) -> None:
    with pytest.raises(InputError, match="rows"):
        find_singularities((robot_2r, Pose("ee")))
    with pytest.raises(InputError, match=r"part: platform of robot .* has no inputs"):
        find_singularities((planar, XY), part="platform")
    with pytest.raises(InputError, match=r"q: .*expected 5 numbers"):
        nearest_singularity((robot_2r, XY), [1.0, 2.0])
