"""The way ahead without Coal: configurations, placements and lower bounds of distances."""

import itertools
import subprocess
import sys

import numba
import numpy as np
import pytest
from thinned import thinned

import nmm
from nmm.model.collisions import swept as ways
from nmm.model.collisions.pairs import random_configurations
from nmm.model.collisions.swept_check import SweptCheck
from nmm.model.robots.zero_order_hold import HeldInputs

SHAPES = [
    nmm.Box([0.2, 0.5, 0.4]),
    nmm.Sphere(0.2),
    nmm.Cylinder(0.15, 0.6),
    nmm.Capsule(0.1, 0.5),
    nmm.HalfSpace([0.2, -0.1, 1.0]),
]
LOW = [1.2, 0.0, 0.4, 0.3, -0.2, 0.5], [0.0, 0.0, -0.2]


def lookout(robot, shape, acceleration=3.0):
    placement = LOW[1] if isinstance(shape, nmm.HalfSpace) else LOW[0]
    setting = nmm.Collisions(0.02, obstacles=[nmm.Obstacle(shape, placement, name="thing")]).on(robot)
    return setting, SweptCheck(setting.queries, np.full(robot.n_u, acceleration), 0.02, 0.0201)


@pytest.fixture(scope="module")
def tiago():
    return nmm.Scenario.load("tiago_pose").robot()


@pytest.fixture(scope="module")
def planar():
    return nmm.load("unicycle_3r")


@pytest.mark.parametrize(
    ("robot", "shape"),
    thinned(
        itertools.product(["planar", "tiago"], SHAPES),
        lambda case: case[0] == "planar" or case[1] is SHAPES[0],
    ),
)
def test_gaps_are_below_distances_and_meet_them_where_they_were_measured(robot, shape, request):
    setting, look = lookout(request.getfixturevalue(robot), shape)
    queries, scene, ahead = setting.queries, setting.queries.scene, look._way
    every = range(len(setting.names))
    rng = np.random.default_rng(6)

    def gaps(enough=None):
        enough = np.full(len(every), np.inf) if enough is None else enough
        ends = [np.array(queries.places[pair]) for pair in scene.pairs]
        return np.array([ways.gap(scene, ahead, k, ends[k], enough[k]) for k in every])

    met = np.zeros(len(every), dtype=bool)
    for q in random_configurations(setting.robot, 8, seed=7):
        distances = queries.distances(0.0, q, every)
        for k in every:
            ways.renew(*look._both, queries.results, queries.places, k)
        here = gaps()
        assert np.all(here <= distances + 1e-7)
        enough = 0.5 * here
        rough = gaps(enough)
        assert np.all((rough == here) | ((rough >= enough) & (rough <= here + 1e-12)))
        met |= np.abs(here - distances) < 1e-5
        for size in (0.003, 0.05, 1.0):
            near = queries.distances(0.0, q + size * rng.normal(size=len(q)), every)
            assert np.all(gaps() <= near + 1e-7)
    assert met.all()


def test_the_way_is_that_of_inputs_held_and_then_braked(planar):
    look, held = lookout(planar, SHAPES[0])[1], HeldInputs(planar)
    ahead = look._way
    dt, q, u = 0.02, planar.rest, np.array([0.5, 0.7, -1.0, 0.4, 0.9])
    count = ways.lay(look._blocks, q, u, dt)
    share = min(3.0 * dt / np.abs(u))
    for k in range(count):
        there, after, left = q, float(ahead.after[k]), 1.0
        while after > 1e-9:
            step = min(dt, after)
            there, after, left = held(there, left * u, step), after - step, max(left - share, 0.0)
        np.testing.assert_allclose(ahead.q[k], there, atol=1e-12)
    assert ahead.after[count - 1] == pytest.approx(dt * (np.ceil(1.0 / share)))
    assert left <= share
    apart = np.abs(np.diff(ahead.q[:count], axis=0)).sum(axis=1)
    assert apart.max() < 0.01 + np.abs(u).sum() * dt  # a look after the sample in which it has gone so far


def test_what_is_found_short_is_what_coal_finds_along_the_way(tiago):
    """Against a look at every pair at every place."""
    setting, look = lookout(tiago, SHAPES[0])
    queries, ahead = setting.queries, look._way
    every, rng = list(range(len(setting.names))), np.random.default_rng(8)
    found = []
    for q in random_configurations(tiago, 25, seed=9):
        u = rng.normal(size=tiago.n_u)
        queries.measure(0.0, q)
        queries.scene.bounds[:] = queries.distances(0.0, q, every)
        q_dot = tiago.S(q) @ u
        look.list_risky(q_dot, u, 0.05, anew=True)
        short = look.first_short(0.0, q, u, 0.05)
        kept = queries.scene.kept.copy()
        worst = [kept - queries.distances(0.0, one, every) for one in ahead.q[: int(ahead.looks)].copy()]
        first = next((k for k, by in enumerate(worst) if by.max() > 1e-7), None)
        if first is None:
            assert short is None or short.by < 1e-6
            continue
        assert short is not None
        assert short.by >= worst[first].max() - 1e-6
        found.append(short.pair)
    assert len(found) > 5


def test_distances_do_not_depend_on_what_was_asked_before(planar):
    setting, _ = lookout(planar, SHAPES[2])
    every = range(len(setting.names))
    for q in random_configurations(planar, 30, seed=10):
        setting.queries.distances(0.0, q, every)
        before = setting.queries.results.copy()
        setting.queries.distances(0.3, q + 0.1, every)
        setting.queries.distances(0.0, q, every)
        assert np.array_equal(setting.queries.results, before, equal_nan=True)


#: A robot that drives at a pillar, in a process of its own: the functions that are loaded by a call.
FIRST_CALLS = """
import gc
import numpy as np
from nmm.model.collisions.swept_check import Short
from nmm.base.kernels.compiled import Compiled

robot = nmm.load("unicycle_3r")
q = robot.q({"q1": -1.0, "q2": 0.7, "q3": 0.5})
task = nmm.Task(nmm.Position("ee"), [3.0, 0.3, 0.5], gain=5.0)
pillar = nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.8, 0.1, 0.5])
keeps = {"limits": nmm.Limits({"platform": 2.0, "arm": 2.4}, acceleration=4.0), "dt": 0.05}
keeps["collisions"] = nmm.Collisions(0.03, obstacles=[pillar])
controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), retreat=RETREAT, **keeps)
made = [one for one in gc.get_objects() if isinstance(one, Compiled)]
before = [len(one.entries) for one in made]
for k in range(60):
    controller(0.05 * k, q)
    q = q + 0.05 * controller.solver.step_memory.q_dot
look = controller.safety_filter
look._lookout.slower(np.ones(robot.n_u), 0.05)
look._brake(3.0, q, np.zeros(robot.n_u), Short(0, 0.05, 1.0, q, 1.0))
assert look.counts.added > 0
assert RETREAT is None or controller.solver.retreat_state.count > 1
print([one.py_func.__name__ for one, n in zip(made, before) if len(one.entries) > n])
"""


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize(
    "retreat",
    [pytest.param("None", marks=pytest.mark.thorough), "nmm.Retreat(stalled=0.1, durations=[0.2])"],
)
def test_no_call_along_the_way_loads_code(retreat):
    """All that a call may need is loaded when the controller is made: else 25 ms within a control loop."""
    command = [sys.executable, "-c", f"import nmm\nRETREAT = {retreat}\n{FIRST_CALLS}"]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
