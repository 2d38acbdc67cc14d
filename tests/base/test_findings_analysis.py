"""The wording of what analyses find, once a code; every code has an example here."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import pytest

from nmm.base.findings import Finding
from nmm.base.latex import Formula, Typeset, formula, linear_formula, minor_name, symbol

SUBJECTS = ("plugins.symbolic.findings", "base.findings.singularities", "base.findings.redundancy")

D, L = symbol("d"), symbol("l1")
C1 = Formula("cos(q1)", r"\cos(q_1)")
SUM = formula(D, " + ", L)
MINOR, OTHER = ("v", "omega"), ("v", "q1")

#: Values of each code, its text; and, of formulas, its LaTeX.
FORMULAS: dict[str, list[tuple[dict[str, Any], str, str]]] = {
    "rank_lost": [
        ({"rank": 3}, "J has rank below 3 everywhere", "$J$ has rank below $3$ everywhere"),
        (
            {"rank": 2, "gone": ["d"], "zero": [SUM]},
            "J has rank below 2 everywhere, for d = 0 and d + l1 = 0",
            "$J$ has rank below $2$ everywhere, for $d = 0$ and $d + l_1 = 0$",
        ),
    ],
    "rank_full": [
        (
            {"rank": 3, "nonzero": [D, L], "moving": [symbol("rho")], "exists": [C1]},
            "J has rank 3 at every configuration, for all nonzero d, l1, wherever rho != 0, "
            "where J exists (cos(q1) != 0)",
            r"$J$ has rank $3$ at every configuration, for all nonzero $d$, $l_1$, wherever $\rho \neq 0$, "
            r"where $J$ exists ($\cos(q_1) \neq 0$)",
        )
    ],
    "rank_except": [
        (
            {"rank": 2, "families": [[C1, D]], "named": {}},
            "J has rank 2 except exactly where cos(q1) = 0 and d = 0",
            r"$J$ has rank $2$ except exactly where $\cos(q_1) = 0$ and $d = 0$",
        ),
        (
            {"rank": 2, "families": [[C1, symbol("Lambda")], [D]], "named": {"Lambda": SUM}, "gone": ["h"]},
            "J has rank 2 except exactly where (cos(q1) = 0 and Λ = 0) or d = 0, for h = 0; Λ = d + l1",
            r"$J$ has rank $2$ except exactly where ($\cos(q_1) = 0$ and $\Lambda = 0$) or $d "
            r"= 0$, for $h = 0$; "
            r"$\Lambda = d + l_1$",
        ),
    ],
    "rank_undecided": [
        (
            {"gone": ["d"]},
            "not decided: where J loses rank for d = 0, as its minors are too large for a proof; --search "
            "looks for it with numbers",
            r"not decided: where $J$ loses rank for $d = 0$, as its minors are too large for a proof; "
            r"\texttt{-{}-search} looks for it with numbers",
        )
    ],
    "rank_bounded": [
        (
            {"rank": 2, "bound": Formula("d^2/2", "d^{2}/2"), "nonzero": ["d"], "here": {"d": (0.3, "m")}},
            "J has rank 2 at every configuration when d != 0, as det J J^T >= d^2/2. That "
            "holds here: d = 0.3 m",
            r"$J$ has rank $2$ at every configuration when $d \neq 0$, as $\det J J^T \geq "
            r"d^{2}/2$. That holds "
            r"here: $d = 0.3$ m",
        )
    ],
    "gram_bound": [
        ({"bound": D}, "det J J^T >= d at every configuration", r"$\det J J^T \geq d$ at every configuration")
    ],
    "zero_angles": [
        (
            {"values": [("q1", Formula("pi/2", r"\pi/2")), ("q2", 0)]},
            "that is q1 = pi/2 and q2 = 0, each up to half turns",
            r"that is $q_1 = \pi/2$ and $q_2 = 0$, each up to half turns",
        )
    ],
    "formulas_without": [({"key": "d"}, "--set d=0 has the formulas", "")],
    "minors_identically_zero": [
        ({}, "every maximal minor is identically 0", "every maximal minor is identically $0$")
    ],
    "minors_zero": [
        (
            {"minors": [MINOR, OTHER], "zero": [SUM]},
            "Δ[v, omega], Δ[v, q1] = 0, as d + l1 = 0",
            r"$\Delta_{v,\omega}$, $\Delta_{v,q_1} = 0$, as $d + l_1 = 0$",
        )
    ],
    "nullstellensatz": [
        (
            {"divided": [D]},
            "1 is a combination of the minors and cos^2 + sin^2 - 1, where d may be divided "
            "by (Nullstellensatz)",
            r"$1$ is a combination of the minors and $\cos^{2} + \sin^{2} - 1$, where $d$ may be divided by "
            "(Nullstellensatz)",
        )
    ],
    "case_covered": [
        (
            {"given": [D], "family": [C1, L]},
            "where d = 0: a part of cos(q1) = 0, l1 = 0",
            r"where $d = 0$: a part of $\cos(q_1) = 0$, $l_1 = 0$",
        )
    ],
    "case_singular": [
        ({}, "every minor has a factor that is 0", "every minor has a factor that is $0$"),
    ],
    "case_regular": [
        ({"minor": MINOR, "form": D}, "Δ[v, omega] = d is not 0", r"$\Delta_{v,\omega} = d$ is not $0$")
    ],
    "case_split": [
        (
            {"given": [D], "minor": MINOR, "form": SUM, "ways": [C1, L], "excluded": [D]},
            "where d = 0: Δ[v, omega] = d + l1 is 0 where cos(q1) = 0 or l1 = 0; d = 0 cannot be there "
            "(Nullstellensatz)",
            r"where $d = 0$: $\Delta_{v,\omega} = d + l_1$ is $0$ where $\cos(q_1) = 0$ or "
            r"$l_1 = 0$; $d = 0$ "
            "cannot be there (Nullstellensatz)",
        ),
        (
            {"minor": MINOR, "form": D, "ways": [], "excluded": []},
            "Δ[v, omega] = d is 0 nowhere",
            r"$\Delta_{v,\omega} = d$ is $0$ nowhere",
        ),
    ],
    "same_set": [
        (
            {"family": [SUM], "simpler": [C1]},
            "d + l1 = 0 is the same as cos(q1) = 0 (each vanishes on the other)",
            r"$d + l_1 = 0$ is the same as $\cos(q_1) = 0$ (each vanishes on the other)",
        )
    ],
    "part_of": [
        ({"family": [D], "whole": [L]}, "d = 0 is a part of l1 = 0", "$d = 0$ is a part of $l_1 = 0$")
    ],
    "combination_constant": [
        (
            {
                "combination": linear_formula([(1, minor_name(MINOR)), (-2, minor_name(OTHER))]),
                "constant": D,
            },
            "Δ[v, omega] - 2 Δ[v, q1] = d, whatever q is",
            r"$\Delta_{v,\omega} - 2 \Delta_{v,q_1} = d$, whatever $q$ is",
        )
    ],
    "squares_bounded": [
        ({"bound": D, "count": 1}, "so its square is d", "so its square is $d$"),
        (
            {"bound": D, "count": 2},
            "so the squares of these minors sum to at least d (Cauchy and Schwarz)",
            "so the squares of these minors sum to at least $d$ (Cauchy and Schwarz)",
        ),
    ],
    "cauchy_binet": [
        (
            {},
            "det J J^T is the sum of the squares of all maximal minors (Cauchy and Binet)",
            r"$\det J J^T$ is the sum of the squares of all maximal minors (Cauchy and Binet)",
        )
    ],
    "terms_bounded": [
        (
            {"terms": [(D, L)]},
            "cosines and sines are at most 1, so that the terms beside d reach at most l1",
            "cosines and sines are at most $1$, so that the terms beside $d$ reach at most $l_1$",
        )
    ],
    "minor_never_zero": [
        (
            {
                "minor": MINOR, "larger": [(formula("|", D, "|"), L)], "nonzero": ["h"], "exact": True,
                "holds": False, "here": {"d": (0.3, "m")},
            },
            "Δ[v, omega] never vanishes when |d| > l1 and h != 0, and only then. That does not hold here: "
            "d = 0.3 m",
            r"$\Delta_{v,\omega}$ never vanishes when $|d| > l_1$ and $h \neq 0$, and only "
            r"then. That does not "
            "hold here: $d = 0.3$ m",
        ),
        (
            {"minor": MINOR, "larger": [], "nonzero": ["rho"], "exact": False, "through": ["rho"]},
            "Δ[v, omega] never vanishes when rho != 0. That depends on the configuration, through rho",
            r"$\Delta_{v,\omega}$ never vanishes when $\rho \neq 0$. That depends on the "
            r"configuration, through "
            r"$\rho$",
        ),
    ],
    "minors_vanishing": [
        (
            {"count": 15},
            "Vanish somewhere, whatever the lengths, joint limits apart: 15 minors",
            "Vanish somewhere, whatever the lengths, joint limits apart: $15$ minors",
        )
    ],
    "minor_vanishing": [
        ({"minor": MINOR}, "Δ[v, omega], as it is 0", r"$\Delta_{v,\omega}$, as it is $0$"),
        (
            {"minor": MINOR, "factor": C1},
            "Δ[v, omega], as cos(q1) is a factor",
            r"$\Delta_{v,\omega}$, as $\cos(q_1)$ is a factor",
        ),
        (
            {"minor": MINOR, "factor": D, "mean_zero": True},
            "Δ[v, omega], as its factor d has mean 0 over the joint angles, so that it changes its sign",
            r"$\Delta_{v,\omega}$, as its factor $d$ has mean $0$ over the joint angles, so "
            r"that it changes its "
            "sign",
        ),
    ],
    "no_partition_everywhere": [
        ({}, "So every minor vanishes somewhere: no partition serves RG everywhere", "")
    ],
    "partitions_everywhere": [
        (
            {"partitions": [MINOR, OTHER]},
            "So [v, omega] and [v, q1] serve RG everywhere",
            r"So $[v, \omega]$ and $[v, q_1]$ serve RG everywhere",
        )
    ],
    "minors_undecided": [
        (
            {"count": 1, "minors": [MINOR]},
            "It is not decided whether Δ[v, omega] vanishes somewhere",
            r"It is not decided whether $\Delta_{v,\omega}$ vanishes somewhere",
        ),
        (
            {"count": 20, "minors": []},
            "It is not decided whether 20 minors vanish somewhere",
            "It is not decided whether $20$ minors vanish somewhere",
        ),
    ],
    "angle_rounded": [
        (
            {"name": "roll_q1", "value": 1.5708, "quarters": 1},
            "roll_q1 = 1.5708 rad taken as 1 pi/2 (3.7e-06 rad away)",
            r"$\mathrm{roll\_q1} = 1.5708$ rad taken as $1 \pi/2$ (3.7e-06 rad away)",
        )
    ],
    "length_symbol": [
        ({"name": "k", "meaning": "half the track_width"}, "k is half the track_width",
         r"$k$ is half the track\_width")
    ],
    "mimic_joint": [
        (
            {"joint": "q3", "leader": "q2", "multiplier": -0.5, "offset": 0.1},
            "q3 = -0.5 q2 + 0.1",
            "$q_3 = -0.5 q_2 + 0.1$",
        )
    ],
}  # fmt: skip

SINGULARITIES: dict[str, list[tuple[dict[str, Any], str]]] = {
    "sizes_in_length": [({"length": 0.8}, "singular values count lengths in L = 0.8 m")],
    "sizes_mixed": [
        ({}, "singular values count 1 m as much as 1 rad; --length L counts lengths in L")
    ],
    "inputs_idle_here": [({"inputs": ["v", "q5"]}, "do not move the task here: v, q5")],
    "rank_lost_here": [
        (
            {"rank": 1, "rows": 3, "lost": ["ee.x", "ee.y"]},
            "Singular: J has rank 1 of 3. No input moves ee.x; ee.y.",
        ),
        ({"rank": 1, "rows": 6, "lost": list("abcde")},
         "Singular: J has rank 1 of 6. No input moves 5 directions."),
    ],
    "nonsingular": [
        (
            {"rank": 2, "weakest": "ee.x", "sigma_min": 0.85900001},
            "Nonsingular: J has rank 2. Weakest is ee.x, at σ_min = 0.859.",
        )
    ],
    "given_back": [
        (
            {"directions": ["ee.x"], "too_few": False},
            "The platform gives back what the arm alone has lost: ee.x.",
        ),
        (
            {"directions": ["ee.x"], "too_few": True},
            "The platform gives back what the arm has too few joints for: ee.x.",
        ),
    ],
    "nothing_given_back": [({}, "The platform gives back nothing of what the arm alone has lost.")],
    "sigma_constant": [({}, "No input changes σ_min to first order.")],
    "sigma_changes": [
        (
            {"motions": [("q1", -0.48, "rad", 0), ("v", 0.3, "m", 0)], "more": 2},
            "σ_min changes with q1 (σ_min -0.48 per rad), v (+0.3 per m) and 2 more.",
        )
    ],
    "sigma_grows": [({"direction": "q1", "rate": 0.52}, "It grows fastest along q1 (+0.52).")],
    "rank_restored": [
        (
            {"motions": [("q1", 0.0, "rad", 1), ("q2", 0.5, "rad", 2)], "lost": 2, "more": 0},
            "Comes back with q1 (1 of 2 directions), q2 (+0.5 per rad).",
        )
    ],
    "rank_restored_best": [({"direction": "q1", "rate": 0.5}, "Best together: q1 (σ_min +0.5).")],
    "rank_not_restored": [({}, "No input brings it back, to first order.")],
    "restored_across": [
        ({"coordinates": ["y"]}, "A motion along y would, which the wheels do not admit.")
    ],
    "all_minors_zero": [
        ({"count": 1}, "The only minor is 0."),
        ({"count": 6}, "All 6 minors are 0, and det J Jᵀ with them."),
    ],
    "some_minors_zero": [
        (
            {"inputs": ["steering_rate", "q5"], "others": [("v", "q2")]},
            "0: every minor with steering_rate or q5; Δ[v, q2]",
        ),
        ({"inputs": [], "others": [("v", "q2")] * 40}, "0: 40 minors"),
        ({"inputs": ["q5"], "others": [("v", "q2")] * 40}, "0: every minor with q5; 40 others"),
    ],
    "minor_squares": [
        (
            {"squares": 1.5, "gram": 1.5},
            "sum of their squares 1.5, det J Jᵀ 1.5 (equal: Cauchy-Binet)",
        )
    ],
    "gram": [({"gram": 1.5, "count": 6}, "det J Jᵀ 1.5, the sum of the squares of all 6 minors")],
    "minors_not_listed": [
        ({"first": ["v", "q1"]}, "they are not listed: --minors lists all, --minor v,q1 that one")
    ],
    "rg_kinematic": [
        ({}, "The singularity is kinematic, J's own: RG fails with every partition, as other resolvers do.")
    ],
    "rg_exhausted": [
        (
            {"own": True, "singular": [("v", "q2")], "count": 1},
            "RG, with the scenario's partitions: [v, q2] is singular, algorithmic: J is not, but RG has no "
            "other partition.",
        )
    ],
    "rg_algorithmic": [
        (
            {"own": False, "singular": [("q1", "q2"), ("v", "q1")], "count": 6, "best": ("v", "omega"),
             "ratio": 0.797},
            "RG: [q1, q2], [v, q1] are singular though J is not (algorithmic); best is [v, omega] (0.797).",
        ),
        (
            {"own": False, "singular": [("q1", "q2")] * 7, "count": 9, "best": None, "ratio": 0.0},
            "RG: 7 of 9 partitions are singular though J is not (algorithmic).",
        ),
    ],
    "rg_regular": [
        (
            {"own": True, "best": ("v", "omega"), "ratio": 0.5},
            "RG, with the scenario's partitions: no partition is singular here; best is [v, omega] (0.5).",
        )
    ],
    "ej_matrix": [
        (
            {"added": ["y"], "determinant": 0.0, "rank": 3, "count": 4, "sigma_min": 0.0,
             "condition": float("inf")},
            "EJ, with the added task y: det J_e = 0, rank 3 of 4, σ_min 0, condition inf.",
        )
    ],
    "ej_kinematic": [({}, "J_e is singular because J is: a kinematic singularity.")],
    "ej_added_singular": [
        ({}, "EJ fails here though J has full rank: the added task's own rows depend on each other.")
    ],
    "ej_algorithmic": [
        (
            {"lost": ["ee.x - y"]},
            "An algorithmic singularity: J_e is singular though neither J nor the added task's J_y is. Both "
            "speak of the same: no input moves ee.x - y.",
        )
    ],
    "ej_angle": [
        (
            {"measure": 0.5},
            "|det J_e|/√(det J Jᵀ det J_y J_yᵀ) = 0.5: 1 where the added task moves only "
            "what the task leaves "
            "free, 0 where it asks for what the task fixes.",
        )
    ],
    "run_singular": [
        (
            {"singular": 1, "samples": 11, "t": 1.0, "rank": 1, "rows": 2},
            "Singular at 1 of 11 samples, the first at 1 s: rank 1 of 2.",
        )
    ],
    "run_regular": [
        (
            {"rows": 2, "condition": 3.5, "t": 0.2},
            "J has rank 2 at every sample; its condition is at most 3.5, at 0.2 s.",
        )
    ],
    "sigma_dips": [
        (
            {"threshold": 0.1, "dips": [(1.0, 0.05, False), (2.0, 0.0, True)], "more": 3},
            "σ_min comes below 0.1 at 1 s (0.05), 2 s (0, an end) and 3 more times.",
        )
    ],
    "sigma_stays": [({"threshold": 0.1}, "σ_min never comes below 0.1.")],
    "arm_dips": [
        (
            {"sigma_min": 0.0, "t": 0.0},
            "The arm alone does, down to 0 at 0 s: the platform makes up for it.",
        )
    ],
    "more_partition_changes": [({"count": 3}, "and 3 more changes")],
    "more_crossings": [({"count": 3}, "and 3 more: --json has all, --minor chooses")],
    "no_crossing": [({}, "No minor changes its sign.")],
    "zero_throughout": [
        ({"minors": [("v", "q2")]}, "0 on the whole motion: Δ[v, q2]"),
        ({"minors": [("v", "q2")] * 5}, "0 on the whole motion: 5 minors"),
    ],
    "minors_not_followed": [
        (
            {"count": 210, "first": ["v", "q1"]},
            "210 minors are not looked at: --minors does, --minor v,q1 looks at this one",
        )
    ],
    "ej_sigma": [({"sigma_min": 0.25, "t": 2.0}, "EJ: σ_min of J_e is at least 0.25, at 2 s.")],
    "ej_dips": [
        ({"threshold": 0.1, "dips": [(1.0, 0.05, False)], "more": 0}, "It comes below 0.1 at 1 s (0.05).")
    ],
    "ej_algorithmic_dips": [({}, "J's does not: these are algorithmic, EJ's own.")],
}  # fmt: skip

REDUNDANCY: dict[str, list[tuple[dict[str, Any], str]]] = {
    "redundancy_of": [({"robot": "r", "rows": ["ee.x", "ee.y"]}, "r, task ee.x, ee.y")],
    "redundancy_sizes": [
        ({"n": 5, "following": 0, "inputs": 4, "rows": 1},
         "n = 5 coordinates, n_u = 4 inputs, s = 1 row of the task"),
        ({"n": 5, "following": 2, "inputs": 4, "rows": 2},
         "n = 5 coordinates (and 2 that follow others), n_u = 4 inputs, s = 2 rows of the task"),
    ],
    "static_redundancy": [
        ({"n": 5, "rows": 2, "degree": 3}, "static redundancy       n - s = 5 - 2 = 3 (configurations)")
    ],
    "kinematic_redundancy": [
        ({"inputs": 4, "rows": 2, "degree": 2}, "kinematic redundancy  n_u - s = 4 - 2 = 2 (motions)")
    ],
    "redundancy_at": [({"q": {"x": 0.0, "q1": 0.52359}}, "at x = 0, q1 = 0.5236:")],
    "configurations_free": [
        ({"rank": 2, "rows": 2, "dimension": 3},
         "  rank of ∂f/∂q 2 of 2: configurations with this task value form a manifold of dimension 3")
    ],
    "motions_free": [
        ({"rank": 2, "rows": 2, "count": 1},
         "  rank of J 2 of 2: 1 motion of the inputs leaves the task at rest"),
        ({"rank": 2, "rows": 2, "count": 0},
         "  rank of J 2 of 2: no motions of the inputs leave the task at rest"),
    ],
    "singular_inputs": [
        ({"lost": 1},
         "  1 direction of the task that the coordinates move is moved by no input here: J is singular, "
         "∂f/∂q is not")
    ],
    "self_motions": [
        ({"count": 1}, "the task stays at rest in this motion (--self-motion takes its number):"),
        ({"count": 2},
         "the task stays at rest in each of these motions (--self-motion takes their numbers):"),
    ],
    "self_motion": [
        ({"number": 0, "motion": "q1 turns", "alone": False, "everywhere": False}, "  0  q1 turns"),
        ({"number": 1, "motion": "q1 turns", "alone": True, "everywhere": True},
         "  1  q1 turns (without effect on the task)"),
        ({"number": 1, "motion": "q1 turns", "alone": True, "everywhere": False},
         "  1  q1 turns (without effect on the task here)"),
    ],
    "self_motions_combined": [
        ({"count": 1}, "and in its opposite"), ({"count": 2}, "and in their opposites and combinations")
    ],
    "nothing_withheld": [
        ({}, "the inputs give every motion of the coordinates that leaves the task at rest")
    ],
    "motions_withheld": [
        ({"dimension": 3, "count": 1},
         "the coordinates could move in 3 independent ways with the task at rest; the wheels withhold 1 of "
         "them, which no input gives:")
    ],
    "motion_withheld": [
        ({"motion": "the platform slides left", "coordinates": "y"},
         "  - the platform slides left (q_dot: y)")
    ],
    "manoeuvres": [
        ({"given": 1, "withheld": 1},
         "but a manoeuvre gives it, the task at rest all the while: two motions of the inputs in turn, there "
         "and back (rank of the Lie brackets); so every configuration nearby with this task value can be "
         "reached"),
        ({"given": 1, "withheld": 2},
         "manoeuvres, two motions of the inputs in turn, there and back, give 1 of them (rank of the Lie "
         "brackets; longer manoeuvres were not looked at)"),
        ({"given": 0, "withheld": 1},
         "manoeuvres, two motions of the inputs in turn, there and back, do not give it either (rank of the "
         "Lie brackets; longer manoeuvres were not looked at)"),
    ],
    "no_manoeuvre": [
        ({"free": 0, "withheld": 1},
         "nor does a manoeuvre give it with the task at rest all the while: no motion of the inputs leaves "
         "the task at rest"),
        ({"free": 1, "withheld": 2},
         "nor does a manoeuvre give them with the task at rest all the while: only one motion of the inputs "
         "leaves the task at rest, and it only leads there and back"),
    ],
    "laps_ended": [({"lap": 2, "message": "diverged"}, "ended in lap 2: diverged")],
    "laps_repeat": [({"drift": 4.9e-15}, "repeats itself: drift 4.9e-15 in the last lap")],
    "laps_too_few": [
        ({"drift": 0.1}, "drift 0.1 in the last lap; expected at least 3 laps to tell whether it falls")
    ],
    "laps_converge": [
        ({"drift": 0.1, "factor": 0.5},
         "converges: drift 0.1 in the last lap, 0.5 times that of the lap before")
    ],
    "laps_drift": [
        ({"drift": 0.1, "factor": 1.0}, "drifts: 0.1 in the last lap, 1 times that of the lap before")
    ],
    "full_turns": [
        ({"turns": {"theta": 1, "q2": -1}}, "full turns in the last lap: theta +1, q2 -1")
    ],
    "first_lap": [
        ({"error": 2.168, "on_path": False},
         "lap 1 begins 2.17 off the path, in the posture given: its drift holds the transient"),
        ({"error": 0.0, "on_path": True},
         "lap 1 begins on the path, in the posture given: its drift holds the transient"),
    ],
}  # fmt: skip

EXAMPLES: dict[str, list[Any]] = {**FORMULAS, **SINGULARITIES, **REDUNDANCY}


@pytest.mark.parametrize("subject", SUBJECTS)
def test_every_code_has_an_example(subject: str) -> None:
    table = import_module(f"nmm.{subject}").WORDS
    assert set(table) <= set(EXAMPLES)


def test_no_example_is_of_a_code_that_is_gone() -> None:
    codes = {code for subject in SUBJECTS for code in import_module(f"nmm.{subject}").WORDS}
    assert set(EXAMPLES) == codes


@pytest.mark.parametrize("code", EXAMPLES)
def test_words(code: str) -> None:
    for values, text, *latex in EXAMPLES[code]:
        said = str(Finding(code, values))
        assert said == text
        if latex and latex[0]:
            assert isinstance(said, Typeset)
            assert said.latex == latex[0]
