"""Functions of a user's own: what they get, what their differences cost, and what a run says of it."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from derivatives import check_function
from findings import codes, the
from numpy.typing import NDArray
from places import ROOT

import nmm
from nmm import Configuration
from nmm.control.functions.program import evaluate
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]
Q = [0.1, -0.2, 0.3, 0.8, -0.5]


def hand(configuration: Configuration) -> Array:
    return np.array(configuration.placement("ee").translation[:2])


def hand_moves(configuration: Configuration) -> Array:
    return configuration.jacobian("ee")[:2]


def folded(configuration: Configuration) -> float:
    return 0.5 * float(configuration.q[4]) ** 2


def controller(robot: Robot, **derivatives: Callable[..., Any] | None) -> nmm.Controller:
    task = nmm.Task(
        nmm.CallableFunction(hand, ["x", "y"], units=["m", "m"], jacobian=derivatives.get("jacobian")),
        nmm.CallableReference(lambda t: [1.0, 0.1 * t], 2, rate=derivatives.get("rate")),
        2.0,
    )
    objective = nmm.CallableObjective(folded, derivatives.get("gradient"))
    return nmm.Controller(robot, task, nmm.ProjectedGradient(), objective)


PAGE = ROOT / "docs" / "tutorials" / "your_own.md"


def test_the_pages_functions_need_no_differences_and_their_derivatives_are_right() -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    (mine,) = (block for block in blocks if block.startswith("# mine.py"))
    (eight,) = (block for block in blocks if "CallableReference" in block)
    names: dict[str, Any] = {}
    exec(mine + eight, names)
    robot = nmm.load("unicycle_3r")
    q = robot.q({"x": 0.3, "theta": 0.4, "q1": 0.3, "q2": 0.5, "q3": 1.2})
    function = nmm.CallableFunction(names["reach"], ["reach"], units=["m"], jacobian=names["reach_slope"])
    objective = nmm.CallableObjective(names["elbow"], gradient=names["elbow_slope"])
    for one in (function, names["figure_eight"], objective):
        check_function(one, robot, 0.7, q)
    own = nmm.Controller(robot, nmm.Task(function, [0.9]), nmm.ProjectedGradient(), objective)
    run = nmm.simulate(own, q, 0.1)
    assert run.outcome == "completed"
    assert "python_costs" not in codes(run)
    resolver = nmm.CallableResolver(names["least_norm"])
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": "0.5"}).with_resolver(resolver)
    with_own = scenario.override("duration", 1).run()
    assert (with_own.outcome, with_own.resolver, with_own.t[-1]) == ("completed", "callable", 1.0)
    assert with_own.scenario is not None
    assert with_own.scenario["resolver"] == {"kind": "own", "source": "callable"}
    assert scenario.with_resolver("pg").run().resolver == "pg"


def test_every_row_of_the_pages_tables_is_what_a_configuration_has(robot_2r: Robot) -> None:
    _, _, table = PAGE.read_text(encoding="utf-8").partition("A `Configuration` is not q")
    here, n = Configuration(robot_2r, Q), robot_2r.n
    named = re.findall(r"^\| `(?:configuration)?\.(\w+)", table, flags=re.MULTILINE)
    assert named == ["q", "placement", "jacobian", "hessian", "center_of_mass", "S"]
    assert here.q.shape == (n,)
    assert here.placement("ee").translation.shape == (3,)
    assert here.jacobian("ee").shape == (6, n)
    assert here.hessian("ee").shape == (6, n, n)
    assert [part.shape for part in here.center_of_mass()] == [(3,), (3, n)]
    assert here.S.shape == (n, robot_2r.n_u)


def test_a_run_says_once_what_differences_stand_for(robot_2r: Robot) -> None:
    run = nmm.simulate(controller(robot_2r), Q, 0.1)
    assert codes(run) == {"python_costs"}
    function, reference, objective = run.warnings  # the wording of the three stands in functions/callbacks.py
    assert "callable function hand has no jacobian" in function
    assert "jacobian=" in function
    assert "twice a coordinate" in function
    assert re.match(r"callable reference <lambda> \(test_callables.py:\d+\) has no rate:", reference)
    assert "called once for its value and, for differences, twice; rate=" in reference
    assert "callable objective folded has no gradient" in objective
    assert "gradient=" in objective


def test_nothing_is_said_where_all_derivatives_are_given(robot_2r: Robot) -> None:
    given = controller(
        robot_2r,
        jacobian=hand_moves,
        rate=lambda t: [0.0, 0.1],
        gradient=lambda configuration: configuration.q * [0, 0, 0, 0, 1],
    )
    assert nmm.simulate(given, Q, 0.1).warnings == ()


def test_of_tasks_that_come_and_go_it_is_said_once(robot_2r: Robot) -> None:
    function = nmm.CallableFunction(hand, ["x", "y"], units=["m", "m"])
    tasks = [
        nmm.Task(function, [1.0, 0.5], 2.0, name="first", when=[nmm.Between(0.0, 0.1)]),
        nmm.Task(function, [1.0, 0.4], 2.0, name="second", when=[nmm.Between(0.1)]),
    ]
    run = nmm.simulate(nmm.SequencedController(robot_2r, tasks, nmm.ProjectedGradient()), Q, 0.2)
    assert len(run.events) >= 2
    assert "has no jacobian" in the(run, "python_costs").values["text"]


def test_two_functions_are_compared_at_the_same_configurations(robot_2r: Robot) -> None:
    """Kinematics are computed once for both: 2 n neighbours and the configuration itself, a call."""
    seen: dict[str, list[Configuration]] = {"f": [], "H": []}

    def noting(key: str, function: Callable[[Configuration], Any]) -> Callable[[Configuration], Any]:
        def noted(configuration: Configuration) -> Any:
            seen[key].append(configuration)
            return function(configuration)

        return noted

    task = nmm.Task(nmm.CallableFunction(noting("f", hand), ["x", "y"]), [1.0, 0.5], 1.0)
    objective = nmm.CallableObjective(noting("H", folded))
    made = nmm.Controller(robot_2r, task, nmm.ProjectedGradient(), objective)
    for one in seen.values():
        one.clear()
    made(0.0, Q)
    assert len(seen["f"]) == 2 * robot_2r.n + 1
    assert [id(one) for one in seen["f"]] == [id(one) for one in seen["H"]]
    # One that is kept keeps no others alive.
    assert not seen["f"][0]._neighbours


def test_a_function_that_returns_one_array_again_and_again(robot_2r: Robot) -> None:
    kept = np.zeros(2)

    def same(configuration: Configuration) -> Array:
        kept[:] = hand(configuration)
        return kept

    here = Configuration(robot_2r, Q)
    found = evaluate(nmm.CallableFunction(same, ["x", "y"]), 0.0, here)
    np.testing.assert_allclose(found.value_q, hand_moves(here), atol=1e-9)
    np.testing.assert_array_equal(found.value, hand(here))


@pytest.mark.parametrize("value", [1, True, np.float32(2.5), [2.5], np.array([[2.5]])])
def test_one_number_may_come_in_any_shape(value: Any, robot_2r: Robot) -> None:
    objective = nmm.CallableObjective(lambda configuration: value, lambda configuration: np.zeros(5))
    assert objective.value(Configuration(robot_2r, Q)) == float(np.ravel(value)[0])


def test_a_rate_whose_square_overflows_warns_nobody(robot_2r: nmm.Robot) -> None:
    task = nmm.Task(nmm.Position("ee", "xy"), [1e200, 0.0], gain=1.0)
    controller = nmm.Controller(robot_2r, task, nmm.CallableResolver(lambda problem: np.zeros(4)))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        with pytest.raises(nmm.RunError, match="not finite"):
            controller(0.0, robot_2r.q({"q2": 0.5}))
