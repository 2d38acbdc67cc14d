"""Where J loses rank and which minors never vanish: the statements of the paper's section V, each proved.

The sentences, and where they are:
  V-A   "Δ12 and Δ13 cannot simultaneously vanish if d ≠ 0": `test_two_minors_differ_by_d`
        "rank J(q) = 2 everywhere and the NMM has no singular configurations": `test_no_singularity_with_d`
        "(as opposed to the manipulator taken alone)": `test_the_manipulators_alone`
        "if d > l1 + l2, Δ12 is always nonzero": `test_minors_that_never_vanish`
        "In general, one may need to switch" between Δ12 and Δ13: `test_minors_that_never_vanish`
        "as long as d ≠ 0, Δ123 never vanishes and the Jacobian has full rank everywhere": both
  V-B   "Λ = 0 corresponds to the shoulder singularity": `test_the_manipulators_alone`
        "No minor is always nonzero in this case": `test_minors_that_never_vanish`
        "if s2 ≠ 0 or s3 ≠ 0 there is always a nonzero minor", "rank J(q) = 3, except when the manipulator is
        stretched or folded along the vertical direction": `test_the_3r_is_singular_when_vertical`
  VI-1  "Since d < l1 + l2, there is no minor guaranteed to be always nonzero": as in V-A
  VI-3  "Δ123 = d ≠ 0, and thus rank J(q) = 3 everywhere", for link 1: "link heading" in the tests of V-A
What d = 0 does is not in the paper: `WITHOUT_D`.
"""

from __future__ import annotations

import itertools
from typing import Any

import flint
import numpy as np
import pytest
import sympy
from numpy.typing import NDArray
from scipy.optimize import least_squares
from symbolic_checks import PAPER, TASKS, made
from thinned import thinned

from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.control.functions.tasks import Heading, LinearCoordinates, Position
from nmm.model.platforms import Omnidirectional
from nmm.model.robots.loading import load
from nmm.plugins.symbolic import SymbolicAnalysis, lower_bound, never_zero, singular_set, symbolic, vanishing
from nmm.plugins.symbolic.zeros import GroebnerBasis, GroebnerLimits, Undecided, Zeros

Array = NDArray[np.float64]

#: The singular sets for d = 0, as families of conditions in the symbols' names.
WITHOUT_D: dict[tuple[str, str], list[set[str]]] = {
    ("unicycle_2r", "position"): [{"cos(q1)", "sin(q2)"}],
    ("unicycle_2r", "pointing"): [{"cos(q1)"}],
    ("unicycle_2r", "link heading"): [{"cos(q1 + q2)"}],
    ("unicycle_2r", "link pointing"): [{"rho*cos(q1 + q2) + l1*cos(q1)*cos(theta + q1 + q2 - g)"}],
    # The tip above the column and the arm's plane along the heading; the tip above the column and the elbow
    # stretched or folded (s2 = s3 = 0, or l2 = l3); the elbow so and the arm's plane across the heading.
    ("unicycle_3r", "spatial position"): [
        {"sin(q1)", "l2*sin(q2) + l3*sin(q2 + q3)"},
        {"sin(q3)", "l2*sin(q2) + l3*sin(q2 + q3)"},
        {"cos(q1)", "sin(q3)"},
    ],
}


def residuals(analysis: SymbolicAnalysis, expressions: Any, lengths: dict[str, float]) -> Any:
    """Expressions as a function of q."""
    given = {analysis.symbols[name]: analysis.definitions[name] for name in analysis.definitions}
    numbers = {analysis.symbols[name]: value for name, value in lengths.items()}
    found = [sympy.sympify(one).subs(given).subs(numbers) for one in expressions]
    function = sympy.lambdify([list(analysis.q.values())], found)
    return lambda q: np.array(function(q), dtype=float) * np.ones(len(found))


def zeros_of(function: Any, n: int, rng: np.random.Generator, starts: int) -> list[Array]:
    """Where least squares from random starts find all residuals to be zero."""
    found = []
    for q0 in rng.uniform(-3, 3, (starts, n)):
        solution = least_squares(function, q0, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if np.max(np.abs(solution.fun)) < 1e-12:
            found.append(solution.x)
    return found


def sympified(analysis: SymbolicAnalysis, text: str) -> Any:
    return sympy.sympify(text, locals=dict(analysis.symbols))


@pytest.mark.parametrize(("robot", "task"), PAPER[:-1])
def test_no_singularity_with_d(robot: str, task: str, rng: np.random.Generator) -> None:
    _, _, analysis = made(robot, task)
    claim = singular_set(analysis)
    assert claim.proved
    assert not claim.families
    s = len(analysis.row_names)
    rho = {"moving": ["rho"]} if task == "link pointing" else {}  # it depends on q
    assert claim.statement == Finding("rank_full", {"rank": s, "nonzero": ["d"], **rho})
    # Whatever the lengths: where the minors are smallest, they are not all small.
    functions = analysis.functions()
    for lengths in ({}, {"l1": 0.4, "l2": 0.4}, {"d": -0.05, "l1": 0.9}):
        given = {**analysis.geometry, **lengths}
        J = functions.J(rng.uniform(-3, 3, (500, 5)), **given)
        assert np.min(np.linalg.svd(J)[1]) > 0.02 * abs(given["d"])


@pytest.mark.parametrize(
    ("robot", "task"), thinned(PAPER, lambda case: case[1] not in ("pointing", "link heading"))
)
def test_what_d_zero_does(robot: str, task: str, rng: np.random.Generator) -> None:
    analysis = made(robot, task)[2]
    claim = singular_set(analysis, zero=["d"])
    assert claim.proved
    assert claim.statement.values["gone"] == ["d"]
    assert {name[0] for name in claim.statement.values["nonzero"]} == {"l"}
    expected = [{sympified(analysis, text) for text in family} for family in WITHOUT_D[robot, task]]
    for family in expected:
        assert any({sympy.expand(one) for one in found} == family for found in claim.families)
    assert len(claim.families) == len(expected)
    # Where all conditions of a family vanish J has lost rank ...
    without = analysis.without("d")
    functions, s = without.functions(), len(analysis.row_names)
    for lengths in (without.geometry, dict.fromkeys(without.geometry, 0.4)):
        for family in claim.families:
            points = zeros_of(residuals(without, family, lengths), len(analysis.q), rng, 4)
            assert points
            for q in points:
                assert np.linalg.svd(functions.J(q, **lengths))[1][s - 1] < 1e-9
        # ... and where J has lost rank, those of a family vanish.
        minors = residuals(without, [m for m in without.minors.values() if m != 0], lengths)
        points = zeros_of(minors, len(analysis.q), rng, 20)
        assert len(points) > 4
        everything = [residuals(without, family, lengths) for family in claim.families]
        for q in points:
            assert min(np.max(np.abs(function(q))) for function in everything) < 1e-4


def test_the_3r_is_singular_when_vertical(rng: np.random.Generator) -> None:
    _, _, analysis = made("unicycle_3r", "spatial position")
    claim = singular_set(analysis)
    assert claim.proved
    values = {"rank": 3, "families": [["sin(q2)", "sin(q3)"]], "named": {}, "nonzero": ["d", "l2", "l3"]}
    assert claim.statement == Finding("rank_except", values)
    assert set(claim.conditions) == {sympy.sin(analysis.symbols["q2"]), sympy.sin(analysis.symbols["q3"])}
    J = analysis.functions().J
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        for q2, q3 in itertools.product((0.0, np.pi), repeat=2):
            assert np.linalg.matrix_rank(J([*q[:4], q2, q3]), tol=1e-10) < 3
        assert np.linalg.matrix_rank(J([*q[:4], 0.0, 0.4])) == 3
        assert np.linalg.matrix_rank(J([*q[:4], 0.4, 0.0])) == 3
        # Also where l2 = l3, with link 3 folded onto link 2: the tip is at the shoulder.
        assert np.linalg.matrix_rank(J([*q[:4], 0.4, np.pi], l2=0.5, l3=0.5)) == 3


def test_the_proof_goes_through_all_cases() -> None:
    claim = singular_set(made("unicycle_3r", "spatial position")[2])
    first = {
        "minor": ("v", "omega", "q2"),
        "form": "-Λ (d + Λ c1)",
        "ways": ["Λ", "d + Λ c1"],
        "excluded": [],
    }
    assert claim.steps[0] == Finding("case_split", first)
    assert Finding("case_singular", {"given": ["Λ", "s23"]}) in claim.steps
    splits = [step.values for step in claim.steps if step.code == "case_split"]
    assert any(one.get("given") == ["d + Λ c1"] and not one["ways"] for one in splits)
    simpler = {"family": ["Λ", "s23"], "simpler": ["sin(q2)", "sin(q3)"]}
    assert claim.steps[-1] == Finding("same_set", simpler)


def test_the_manipulators_alone() -> None:
    planar = symbolic(load("unicycle_2r", platform="fixed"), Position("ee", "xy"))
    assert singular_set(planar).families == ((sympy.sin(planar.symbols["q2"]),),)
    spatial = symbolic(load("unicycle_3r", platform="fixed"), Position("ee"))
    elbow, shoulder = sorted(singular_set(spatial).families, key=lambda family: len(str(family)))
    assert elbow == (sympy.sin(spatial.symbols["q3"]),)
    assert sympy.expand(shoulder[0]) == made("unicycle_3r", "spatial position")[2].named["Lambda"]


def test_two_minors_differ_by_d(rng: np.random.Generator) -> None:
    robot, _, analysis = made("unicycle_2r")
    bound = lower_bound(analysis)
    assert bound.proved
    assert bound.statement == Finding("gram_bound", {"bound": "d^2/2"})
    difference = {"combination": "Δ[v, omega] - Δ[v, q1]", "constant": "d"}
    assert bound.steps[0] == Finding("combination_constant", difference)
    J = analysis.functions().J(rng.uniform(-np.pi, np.pi, (4000, robot.n)))
    determinants = np.linalg.det(J @ np.swapaxes(J, 1, 2))
    assert determinants.min() >= 0.3**2 / 2
    assert determinants.min() < 2 * 0.3**2  # not idle
    alone = lower_bound(made("unicycle_2r", "pointing")[2]).steps[0]
    assert alone.values == {"combination": "Δ[v, omega, q1]", "constant": "d"}
    assert lower_bound(made("unicycle_3r", "spatial position")[2]) is None
    assert lower_bound(analysis.without("d")) is None
    anywhere = symbolic(load("unicycle_2r", platform=Omnidirectional()), TASKS["position"])
    assert lower_bound(anywhere).statement.values == {"bound": "1"}


def test_minors_that_never_vanish(rng: np.random.Generator) -> None:
    q = rng.uniform(-np.pi, np.pi, (4000, 6))
    expected = {
        "position": {"v, omega": ([("|d|", "|l1| + |l2|")], (), True)},
        "pointing": {"v, omega, q1": ([], ("d",), True), "v, omega, q2": ([("|d|", "|l1|")], (), True)},
        "link heading": {"v, omega, q1": ([], ("d",), True)},
        "link pointing": {"v, omega, q1": ([("|rho|", "|l2|")], ("d",), False)},
        "spatial position": {},
    }
    for robot, task in PAPER:
        analysis = made(robot, task)[2]
        bounds = never_zero(analysis)
        found = {", ".join(columns): bound.finding().values for columns, bound in bounds.items()}
        conditions = {name: (one["larger"], one["nonzero"], one["exact"]) for name, one in found.items()}
        assert conditions == expected[task]
        if task == "link pointing":  # rho and g are no coordinates: nothing is said of where it vanishes
            continue
        # All others vanish somewhere whatever the lengths, and take both signs or are 0.
        assert set(vanishing(analysis)) == set(analysis.minors) - set(bounds)
        for d in (0.81, 0.49):
            for columns, values in analysis.functions().minors(q[:, : len(analysis.q)], d=d).items():
                one_sign = np.ptp(np.sign(values)) == 0 and values.any()
                held = columns in bounds and bounds[columns].holds({**analysis.geometry, "d": d})
                assert one_sign == held
    bound = never_zero(made("unicycle_2r")[2])["v", "omega"]
    assert bound.holds({"d": -0.9, "l1": 0.5, "l2": 0.3}) is True
    assert bound.holds({"d": 0.7, "l1": 0.5, "l2": 0.3}) is False
    assert bound.holds({"d": 0.9}) is None


def test_where_a_minor_vanishes_is_said() -> None:
    reasons = vanishing(made("unicycle_3r", "spatial position")[2])
    said = {minor: {**finding.values, "minor": minor} for minor, finding in reasons.items()}
    zero, mean, wave = ("v", "omega", "q1"), ("v", "omega", "q2"), ("v", "q2", "q3")
    assert said[zero] == {"minor": zero}
    assert said[mean] == {"minor": mean, "factor": "Λ", "mean_zero": True}
    assert said[wave] == {"minor": wave, "factor": "sin(q1)", "mean_zero": False}


def test_what_the_statements_leave_out() -> None:
    """Where J does not exist, and a task that is singular everywhere."""
    car = symbolic(load("car_base"), Heading("arm_mount"))
    claim = singular_set(car)
    assert claim.families == ((sympy.sin(car.symbols["steering"]),),)
    assert claim.statement.values["exists"] == ["cos(steering)"]
    twice = symbolic(made("unicycle_2r")[0], [LinearCoordinates("q1"), LinearCoordinates({"q1": 2})])
    assert singular_set(twice).statement == Finding("rank_lost", {"rank": 2})
    with pytest.raises(InputError, match="unknown length 'e'"):
        singular_set(made("unicycle_2r")[2], zero=["e"])
    with pytest.raises(InputError, match="L = 0: J is divided by it"):
        singular_set(car, zero=["L"])


def test_what_is_not_decided_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nmm.plugins.symbolic.zeros._SET", GroebnerLimits(2, 5, 100))
    monkeypatch.setattr("nmm.plugins.symbolic.claims._BRIEF", GroebnerLimits(2, 5, 100))
    claim = singular_set(made("unicycle_3r", "spatial position")[2])
    assert not claim.proved
    assert claim.statement == Finding("rank_undecided")
    without = singular_set(made("unicycle_3r", "spatial position")[2], ["d"])
    assert without.statement == Finding("rank_undecided", {"gone": ["d"]})


def test_bases_are_sympys(rng: np.random.Generator) -> None:
    """Ideals of random polynomials; the same reduced basis."""
    names, plenty = ["a", "b", "c"], GroebnerLimits(1000, 1000, 10**6)
    R, *_ = sympy.ring(names, sympy.QQ, "grevlex")
    ring = flint.fmpz_mpoly_ctx.get(names, "degrevlex")
    a, b, c = ring.gens()
    trivial = 0
    for size in range(30):
        generators, same = [], []
        for _ in range(2 + size % 3):
            terms = zip(rng.integers(0, 3, (3, 3)).tolist(), rng.integers(1, 4, 3).tolist(), strict=True)
            polynomial = {tuple(exponents): n for exponents, n in terms}
            generators.append(ring.from_dict(polynomial))
            same.append(R.from_dict({key: R.domain(n) for key, n in polynomial.items()}))
        basis = GroebnerBasis(ring).with_more(generators, plenty)
        whole = sympy.polys.groebnertools.groebner(same, R)

        def members(basis: GroebnerBasis) -> set[Any]:
            return {
                R.from_dict({key: R.domain(int(n)) for key, n in one.terms()}).monic()
                for one in basis.members
            }

        assert members(basis) == set(whole)
        assert basis.is_one == (whole == [1])
        trivial += basis.is_one
        stepwise = GroebnerBasis(ring)
        for generator in generators:
            stepwise = stepwise.with_more([generator], plenty)
        assert members(stepwise) == set(whole)
        assert basis.contains(generators[0] * a - generators[-1])
        assert basis.is_one or not basis.contains(ring.constant(1))
    assert 0 < trivial < 30
    with pytest.raises(Undecided):
        GroebnerBasis(ring).with_more([a**2 - b, a * c - 1], GroebnerLimits(2, 1000, 10**6))


def test_what_is_not_zero_is_divided_out() -> None:
    ring, plenty = flint.fmpz_mpoly_ctx.get(["a", "b", "c"], "degrevlex"), GroebnerLimits(100, 100, 1000)
    a, b, _ = ring.gens()
    assert GroebnerBasis(ring, nonzero=[0]).with_more([a * b, a * (b - 1)], plenty).is_one
    assert not GroebnerBasis(ring).with_more([a * b, a * (b - 1)], plenty).is_one
    assert not GroebnerBasis(ring, nonzero=[2]).with_more([a * b, a * (b - 1)], plenty).is_one


def test_waves_are_combinations_of_as_few_angles_as_there_can_be() -> None:
    analysis = made("unicycle_2r", "link pointing")[2]
    zeros = Zeros([form for form in analysis.minor_forms.values() if form.number], [])
    assert zeros.known("q1")
    assert zeros.known("q2")
    assert not zeros.known("theta")
    assert len(TASKS) == len(PAPER)
