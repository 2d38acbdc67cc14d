"""What a run found: the sentence of each code, its way through files, and trials made only for who reads."""

from __future__ import annotations

import copy
import json
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import the, why

import nmm
from nmm.base.findings import Finding, run, words
from nmm.base.findings.finding import sentence
from nmm.base.findings.run import line
from nmm.cli import runs as commands
from nmm.motion.diagnosis.judgement import Trials
from nmm.motion.verdict import Awaited
from nmm.plugins.robot import bag_findings as bag
from nmm.plugins.robot import findings as loop
from nmm.plugins.robot.calibration import findings as calibrating
from nmm.plugins.robot.calibration import log_findings
from nmm.plugins.robot.calibration.arm import findings as arm

PART = {"name": "q1", "t": 0.5, "value": 1.25, "unit": "rad", "lower": -1.0, "upper": 1.0}
FLAW = {"meaning": "the task Jacobian J lost rank", "lost": ["tilt of tool about x"], "level": None}

#: Code, values, where, and the sentence.
EXAMPLES: list[tuple[str, dict[str, Any], dict[str, Any], str]] = [
    ("said", {"text": "the door is open"}, {}, "the door is open"),
    (
        "singular",
        FLAW,
        {"t": 1.5},
        "at t = 1.5 s: the task Jacobian J lost rank, and the task asks for what no input gives: tilt of "
        "tool about x",
    ),
    (
        "singular",
        {**FLAW, "level": 2, "tasks": ["aim", "reach"], "platform": "the wheels cannot roll"},
        {"t": 0.0},
        "at t = 0 s: the task Jacobian J lost rank, and the task asks for what no input gives: tilt of tool "
        "about x; level 2 (aim and reach) asks for what the levels above it decide; pg and dls damp it "
        "there, ej with singular: damped; the wheels cannot roll",
    ),
    (
        "singular",
        {"meaning": "not finite", "lost": [], "level": None, "undefined": "the task is undefined here"},
        {"t": 2.0},
        "at t = 2 s: not finite: the task is undefined here",
    ),
    (
        "diverged",
        {"what": "inputs", "bound": 1e6},
        {"t": 0.25},
        "at t = 0.25 s the motion has diverged: the inputs are beyond 1e+06",
    ),
    ("failed", {"text": "at t = 1 s: no step"}, {}, "at t = 1 s: no step"),
    ("interrupted", {"end": 10.0}, {"t": 2.5}, "interrupted after 2.5 s of 10 s"),
    ("interrupted_judging", {}, {}, "interrupted while the run was judged"),
    ("reached", {}, {"t": 2.4}, "reached at t = 2.4 s"),
    (
        "not_reached",
        {"within": 4.0, "m": 0.25, "rad": 0.5},
        {},
        "not reached in 4 s: 0.25 m and 0.5 rad are left",
    ),
    ("nothing_to_reach", {"never": []}, {}, "not reached: no task was active at the end"),
    ("nothing_to_reach", {"never": ["aim"]}, {}, "not reached"),
    (
        "task_never_began",
        {"task": "aim", "missing": ["q2 is not at least 5"]},
        {},
        "task aim never began: at the end of the run, q2 is not at least 5",
    ),
    (
        "task_never_began",
        {"task": "aim", "missing": []},
        {},
        "task aim never began: at the end of the run, its conditions did not hold at one time",
    ),
    ("blocked", {"pairs": ["ee and pillar"]}, {}, "blocked by the distance of ee and pillar"),
    (
        "wheels_slid",
        {"speeds": {"left_wheel": 0.2, "right_wheel": 0.1}},
        {"t": 1.5},
        "wheels of the robot's file slid sideways, most at t = 1.5 s: left_wheel (up to 0.2 m/s), "
        "right_wheel (up to 0.1 m/s); is its platform what its wheels allow? (nmm check)",
    ),
    (
        "collided",
        {"name": "ee and ball", "depth": 0.02},
        {"t": 0.5},
        "ee and ball ran into each other from t = 0.5 s on, by up to 0.02 m",
    ),
    (
        "promise_left",
        {
            "initial": 1.0,
            "errors": [
                {"t": 2.0, "error": 0.5, "promised": 0.1},
                {"t": 4.0, "error": 0.2, "promised": 0.01},
            ],
            "end": 4.0,
        },
        {"t": 1.5},
        "the error left its expected decay at t = 1.5 s: 1 at first, 0.5 at t = 2 s (expected 0.1), 0.2 "
        "at the end (expected 0.01)",
    ),
    (
        "shorter_dt",
        {"shorter": 0.005, "dt": 0.01},
        {},
        "with dt = 0.005 s in place of 0.01 s the error decayed as expected when tried",
    ),
    (
        "dt_too_long",
        {"rate": 400.0, "method": "rk4", "dt": 0.01, "part": True},
        {"t": 0.5},
        "for part of the run alpha * dt (or K * dt) is too large: at t = 0.5 s a mode of the closed loop "
        "decays with 400 1/s, which rk4 does not follow with dt = 0.01 s",
    ),
    (
        "dt_too_long",
        {
            "rate": 400.0,
            "method": "rk4",
            "dt": 0.01,
            "part": False,
            "tried": {"dt": 0.005, "start": 0.0, "end": 2.0},
        },
        {"t": 0.5},
        "alpha * dt (or K * dt) is too large: at t = 0.5 s a mode of the closed loop decays with 400 1/s, "
        "which rk4 does not follow with dt = 0.01 s; a dt below 0.005 s follows it (tried from t = 0 to 2 s)",
    ),
    (
        "rate_jumps",
        {"jumps": 2, "size": 1.5, "servo": 5.0},
        {"t": 0.5},
        "the rate that tasks ask for jumps 2 times, by up to 1.5 (m/s, rad/s), first at t = 0.5 s: the "
        "inputs follow it at 5 1/s, with bounded accelerations",
    ),
    (
        "target_jumps",
        {"steps": 12},
        {},
        "the target moved otherwise than its rate says in 12 steps, and the error with it",
    ),
    (
        "out_of_reach",
        {"frame": "ee", "away": 1.7, "side": "above", "joint": "q1", "length": 1.3},
        {},
        "the target of ee is out of reach: it is 1.7 m above q1, its links add up to 1.3 m",
    ),
    (
        "stretched",
        {"frame": "ee", "away": 1.25, "length": 1.3, "joint": "q1"},
        {},
        "the arm is stretched: ee is 1.25 m of 1.3 m from q1",
    ),
    ("nothing_gives", {"lost": ["motion of ee along z"]}, {}, "no input gives: motion of ee along z"),
    (
        "inputs_fell_short",
        {},
        {},
        "the inputs did not do all that the task asked (clipped, scaled or damped)",
    ),
    (
        "inputs_fell_short",
        {"sigma": 0.018, "threshold": 0.05},
        {},
        "the inputs did not do all that the task asked (damped: σ 0.018 is below 0.05)",
    ),
    (
        "still_moving",
        {"name": "v", "mean": 0.5, "unit": "m/s", "duration": 0.4},
        {},
        "the robot has not come to rest: |v| is 0.5 m/s on average over the last 0.4 s",
    ),
    (
        "near_singularity",
        {"condition": 250.0, "lost": "motion of ee along x"},
        {"t": 0.5},
        "J is nearly singular at t = 0.5 s (condition number 2.5e+02), nearly lost: motion of ee along x",
    ),
    (
        "singularity_passed",
        {"before": 0.1, "after": 0.4, "lost": "motion of ee along x"},
        {"t": 0.5},
        "at t = 0.5 s the task error jumped from 0.1 to 0.4 in one step: a singular configuration was passed "
        "between two samples, lost there: motion of ee along x",
    ),
    ("partition_switching", {"times": 5}, {}, "from there on the partition switched 5 times"),
    (
        "inputs_changed",
        {"percent": 62.4},
        {"t": 0.5},
        "along that step the inputs changed by 62 % of their size",
    ),
    (
        "chattering",
        {"input": "q1", "jumps": 8, "end": 1.5, "size": 2.5},
        {"t": 0.5},
        "the inputs chatter: q1 jumps back and forth between samples 8 times from t = 0.5 s to 1.5 s, by up "
        "to 2.5",
    ),
    (
        "extended_jacobian_crossed",
        {"steps": [[0.4, 0.5]], "more": 0},
        {"t": 0.5},
        "J_e was singular between t = 0.4 and 0.5 s (its determinant changes its sign); the inputs go on "
        "without a jump",
    ),
    (
        "extended_jacobian_crossed",
        {
            "steps": [[0.4, 0.5], [0.8, 0.9]],
            "more": 2,
            "name": "v",
            "before": 1.0,
            "after": -1.0,
            "unit": "m/s",
        },
        {"t": 0.5},
        "J_e was singular between t = 0.4 and 0.5 s, 0.8 and 0.9 s and in 2 more steps (its determinant "
        "changes its sign): there v jumps from 1 to -1 m/s, and the motion from there on depends on where "
        "the samples fall; singular: damped drives through",
    ),
    (
        "extended_jacobian_crossed",
        {
            "steps": [[0.4, 0.5]],
            "more": 0,
            "name": "v",
            "before": 1,
            "after": -1,
            "unit": "m/s",
            "J_too": True,
        },
        {"t": 0.5},
        "J_e was singular between t = 0.4 and 0.5 s (its determinant changes its sign): there v jumps from "
        "1 to -1 m/s, and the motion from there on depends on where the samples fall; J itself is nearly "
        "singular: dls continues",
    ),
    (
        "limits_binding",
        {"limits": {"u_v": 0.75, "q1": 0.125}},
        {},
        "limits that bind at λ < 1: input v (75 %), q1 (12 %)",
    ),
    ("setting_parted", {"text": "dt was set alone"}, {}, "dt was set alone"),
    ("python_costs", {"text": "hand has no jacobian"}, {}, "hand has no jacobian"),
    (
        "start_outside_limits",
        {"outside": ["q1 = 1.5 rad (from -1 to 1)"], "recovery": 0.1},
        {},
        "the start is outside limits: q1 = 1.5 rad (from -1 to 1); what is outside comes back at 0.1 m/s or "
        "rad/s",
    ),
    (
        "start_in_degrees",
        {"angles": {"theta": -150.0, "q1": 30.0}},
        {},
        "the start has theta at -150 rad (-23.9 turns) and q1 at 30 rad (4.8 turns); angles are in rad: "
        "-150° is -5*pi/6",
    ),
    (
        "idle_inputs",
        {"inputs": ["steering_rate", "q5"]},
        {},
        "without effect on task and objective: steering_rate, q5; at first order nothing moves them (an "
        "objective can)",
    ),
    (
        "pose_without_feedback",
        {"platform": "car"},
        {},
        "no smooth feedback brings a car platform to a pose x, y, theta that stands (Brockett 1983); "
        "nmm.Parking (task kind parking) and nmm.plan (scenario key plan) do",
    ),
    (
        "no_redundancy",
        {},
        {},
        "the task has as many rows as there are inputs: no redundancy is left to resolve",
    ),
    (
        "inputs_unmet",
        {"samples": 12, "share": 0.06, "largest": 0.4, "relative": 0.5},
        {"t": 0.5},
        "the inputs did not do all that the task asked in 12 samples (6 %): J u differed from the rate by up "
        "to 0.4 (50 % of it), at t = 0.5 s",
    ),
    (
        "inputs_unmet",
        {
            "samples": 1,
            "share": 0.5,
            "largest": 0.4,
            "relative": 1.5,
            "scale": 0.25,
            "kept": ["limits", "distances"],
        },
        {"t": 0.5},
        "the inputs did not do all that the task asked in 1 sample (50 %): J u differed from the rate by up "
        "to 0.4 (more than the rate itself), at t = 0.5 s; under its limits and distances λ falls to 0.25",
    ),
    (
        "inputs_unmet",
        {"samples": 2, "share": 0.5, "largest": 0.4, "relative": 0.5, "scale": 0.25, "kept": []},
        {"t": 0.5},
        "the inputs did not do all that the task asked in 2 samples (50 %): J u differed from the rate by up "
        "to 0.4 (50 % of it), at t = 0.5 s; its resolver scales the rate on purpose, down to 0.25 of it",
    ),
    (
        "moves_otherwise",
        {"name": "bend", "end": 0.4, "moved": 0.0, "recorded": 1.0, "unit": "rad"},
        {"t": 0.3},
        "bend moves otherwise than its recorded rate says from t = 0.3 s to 0.4 s (0 rad/s where 1 rad/s is "
        "recorded): the inputs jump within the steps; method zoh shows what a sampled controller does",
    ),
    (
        "partition_singular",
        {"inputs": ["v", "q1"], "automatic": False},
        {"t": 0.5},
        "at t = 0.5 s the block Ja of [v, q1] became singular and no other candidate was better: give more "
        "partitions",
    ),
    (
        "partition_singular",
        {"inputs": ["v"], "automatic": True},
        {"t": 0.5},
        "at t = 0.5 s the block Ja of [v] became singular and no other candidate was better: J itself is "
        "close to losing rank",
    ),
    (
        "nearly_singular",
        {"condition": 2000.0, "lost": "motion of ee along x", "largest": 4.2},
        {"t": 0.5},
        "at t = 0.5 s the task Jacobian is nearly singular (condition number 2e+03), nearly lost: motion of "
        "ee along x; inputs reach 4.2",
    ),
    (
        "no_answer",
        {"samples": 3, "lost_rank": True},
        {"t": 0.5},
        "the resolver had no answer in 3 samples, from t = 0.5 s on, where J has lost rank: its inputs were "
        "those nearest to rest",
    ),
    (
        "no_answer",
        {"samples": 1, "lost_rank": False},
        {"t": 0.5},
        "the resolver had no answer in 1 sample, from t = 0.5 s on, within the limits: its inputs were those "
        "nearest to rest",
    ),
    (
        "limit_contradicted",
        {"name": "wall", "samples": 4, "beyond": 0.1, "unit": "m/s", "against": ["wall", "v"]},
        {"t": 0.5},
        "the limit of wall could not be kept with the others in 4 samples, from t = 0.5 s on: its rate was "
        "beyond what would keep it by up to 0.1 m/s (what contradicts each other: wall, v)",
    ),
    (
        "coordinates_beyond_limits",
        {"coordinates": [PART, {**PART, "name": "q2", "lower": None}]},
        {},
        "coordinates leave their limits: q1 at 0.5 s (1.25 rad; from -1 to 1), q2 at 0.5 s (1.25 rad; from "
        "-inf to 1)",
    ),
    (
        "inputs_beyond_limits",
        {"inputs": [{"name": "v", "largest": 0.625, "unit": "m/s", "limit": 0.5}]},
        {},
        "inputs exceed their limits: v (0.625 m/s; at most 0.5)",
    ),
    (
        "functions_beyond_limits",
        {"functions": [{**PART, "name": "wall", "beyond": 0.25, "samples": 3, "of": 10}]},
        {},
        "limits of functions are broken: wall at 0.5 s (1.25 rad; from -1 to 1), by 0.25 at most, in 3 of 10 "
        "samples",
    ),
    (
        "horizon_unsolved",
        {"samples": 3, "of": 80},
        {"t": 0.5},
        "no motion ahead was found in 3 of 80 samples, at t = 0.5 s first: the robot went on along the last "
        "one, which ends at rest",
    ),
    (
        "left_plan",
        {"m": 0.25, "rad": 0.5, "samples": 9, "back": 4.0, "tube_m": 0.1, "tube_rad": 0.2},
        {"t": 3.5},
        "the robot left its plan from t = 3.5 s on, by up to 0.25 m and 0.5 rad (more than 0.1 m or 0.2 "
        "rad); back at t = 4 s",
    ),
    (
        "left_plan",
        {"m": 0.25, "rad": 0.5, "samples": 9, "back": None, "tube_m": 0.1, "tube_rad": 0.2},
        {"t": 3.5},
        "the robot left its plan from t = 3.5 s on, by up to 0.25 m and 0.5 rad (more than 0.1 m or 0.2 "
        "rad); not back at the end",
    ),
    (
        "effort_exceeded",
        {"actuator": "left_wheel_joint", "peak": 26.6, "effort": 20.0, "unit": "N m"},
        {"t": 0.0},
        "left_wheel_joint needs 26.6 N m at t = 0 s, 133 % of its 20",
    ),
    (
        "tips",
        {"margin": -0.0125, "edge": ["front", "left"]},
        {"t": 1.5},
        "the robot tips at t = 1.5 s: the zero-moment point is 12.5 mm outside the edge from front to left",
    ),
    (
        "tips",
        {"margin": None, "edge": ["front", "left"], "jumps": {"v": -0.5, "omega": 0.1}},
        {"t": 1.5},
        "the robot tips at t = 1.5 s: the ground would have to pull it down; inputs jump there (v by -0.5, "
        "omega by 0.1): limits.acceleration spreads that over time",
    ),
    (
        "pictures_lost",
        {"lost": 3, "taken": 30, "gap": 0.25},
        {},
        "3 of 30 pictures did not come or did not show all points, for up to 0.25 s at a time",
    ),
    (
        "replanned",
        {"plans": [{"t": 3.5, "m": 0.25, "rad": 0.1, "duration": 9.0}]},
        {"t": 3.5},
        "the robot left its plan at t = 3.5 s, by up to 0.25 m and 0.1 rad, and went on with another; the "
        "last one takes 9 s",
    ),
    (
        "replanned",
        {
            "plans": [
                {"t": 3.5, "m": 0.2, "rad": 0, "duration": 9},
                {"t": 5, "m": 0.1, "rad": 1, "duration": 8},
            ]
        },
        {"t": 3.5},
        "the robot left its plan 2 times from t = 3.5 to 5 s, by up to 0.2 m and 1 rad, and went on with "
        "another; the last one takes 8 s",
    ),
    (
        "not_replanned",
        {"times": 2, "why": "no way found"},
        {"t": 3.5},
        "the robot left its plan, and no other was made, 2 times from t = 3.5 s on: no way found",
    ),
    (
        "plan_cut",
        {"left": 2.5},
        {"t": 20.0},
        "at the end, t = 20 s, the plan that it followed goes on for 2.5 s more",
    ),
    (
        "backed_off",
        {"times": [1.26, 2.76]},
        {},
        "the error stalled and the robot backed off, at t = 1.26 s, 2.76 s",
    ),
    (
        "added_task_missed",
        {"samples": 9, "end": 1.5, "again": True, "largest": 0.3, "unit": "rad/s"},
        {"t": 0.5},
        "the added task was not done in 9 samples, from t = 0.5 to 1.5 s, and is done again from there on: "
        "its rate was missed by up to 0.3 rad/s",
    ),
    ("distances_note", {"text": "left out by the SRDF: 2 pairs"}, {}, "left out by the SRDF: 2 pairs"),
    (
        "start_too_near",
        {"distance": 0.05, "name": "ee and pillar", "clearance": 0.01, "back": 0.5},
        {"t": 0.0},
        "the start is nearer than the distance to keep, 0.05 m: ee and pillar, 0.01 m; back at t = 0.5 s",
    ),
    (
        "start_too_near",
        {"distance": 0.05, "name": "ee and pillar", "clearance": 0.01, "back": None},
        {"t": 0.0},
        "the start is nearer than the distance to keep, 0.05 m: ee and pillar, 0.01 m; not back at the end",
    ),
    (
        "start_too_near",
        {"distance": 0.05, "name": "a and b", "clearance": -0.01, "back": None, "own": True},
        {"t": 0.0},
        "the start is nearer than the distance to keep, 0.05 m: a and b, -0.01 m; not back at the end; for "
        "links that overlap as they are drawn: collisions.ignore (ignore=[(one, other)]), or an SRDF",
    ),
    (
        "distance_not_kept",
        {"distance": 0.05, "samples": 2, "name": "ee and ball", "clearance": 0.01},
        {"t": 0.5},
        "the distance of 0.05 m could not be kept in 2 samples: ee and ball came to 0.01 m at t = 0.5 s",
    ),
    (
        "braked",
        {"samples": 3, "in_vain": 1},
        {},
        "in 3 samples the inputs went towards braking to keep distances, 1 of them in vain",
    ),
    (
        "turned_back_early",
        {"text": "steering at the limit"},
        {},
        "the self-motion turns back early: steering at the limit",
    ),
]


@pytest.mark.parametrize(
    ("text", "values", "said"),
    [
        ("{names:all}", {"names": ["a", "b"]}, "a, b"),
        ("{names:and}", {"names": ["a", "b", "c"]}, "a, b and c"),
        (
            "{names:few %r}",
            {"names": [*"abcdefghijkl"]},
            "'a', 'b', 'c', 'd', 'e', 'f', 'g', 'h', 'i', 'j' and 2 more",
        ),
        ("{at:few %s at %g}", {"at": {"q1": 0.5, "q2": 1.0}}, "q1 at 0.5, q2 at 1"),
        ("{at:all %s from %g to %g}", {"at": {"q1": [0, 1]}}, "q1 from 0 to 1"),
        ("{steps:all %g and %g s}", {"steps": [[0, 1], [2, 3]]}, "0 and 1 s, 2 and 3 s"),
        ("{names:number} {names:plural name|names}", {"names": ["a"]}, "1 name"),
        ("{n:count row}, {n:many row}, {n:plural it|them}", {"n": 0}, "0 rows, no rows, them"),
        ("{n:count row}, {n:many row}, {n:plural it|{n} of them}", {"n": 1}, "1 row, 1 row, it"),
        ("{got:quoted}", {"got": "a\nb"}, "'a\\nb'"),
        ("left{x:if , {x} {y:else no} more}{x:else  alone}", {"x": 2}, "left, 2 no more"),
        ("left{x:if , {x} more}{x:else  alone}", {}, "left alone"),
        ("{t:known at {t:.1f} s}{t:unknown never}", {"t": 0.0}, "at 0.0 s"),
        ("{t:known at {t:.1f} s}{t:unknown never}", {"t": None}, "never"),
        ("{of[a]:g}", {"of": {"a": 1.0}}, "1"),
    ],
)
def test_sentences(text: str, values: dict[str, Any], said: str) -> None:
    assert sentence(text, values) == said


@pytest.mark.parametrize("text", ["{t}", "{t:g}", "{t:all}", "{x:if {t}}"])
def test_value_that_is_not_there(text: str) -> None:
    with pytest.raises(KeyError):
        sentence(text, {"x": 1})


@pytest.mark.parametrize(("code", "values", "where", "sentence"), EXAMPLES)
def test_a_finding_has_its_sentence(
    code: str, values: dict[str, Any], where: dict[str, Any], sentence: str
) -> None:
    found = Finding(code, values, where)
    assert str(found) == sentence
    written = json.loads(json.dumps(found.as_json()))
    assert Finding.from_json(written) == found
    assert written["text"] == sentence


def test_every_code_has_an_example() -> None:
    assert {code for code, *_ in EXAMPLES} == run.WORDS.keys()


def test_every_code_of_the_source_has_words() -> None:
    sources = sorted(Path(nmm.__file__).parent.rglob("*.py"))
    used = {code for one in sources for code in re.findall(r'\bFinding\(\s*"(\w+)"', one.read_text("utf-8"))}
    assert len(used) > 30
    assert used <= words().keys()
    # Those that a function is given, and those of folders written by others.
    given = {"nearly_singular", "near_singularity", "said"}
    assert run.WORDS.keys() <= used | given


def test_a_leg_is_named_once_a_line() -> None:
    leg = {"tasks": ["reach", "aim"], "start": 0.0, "end": 1.5, "also": [2.0, 3.0]}
    found = [Finding("said", {"text": text}, {"leg": leg}) for text in ("first", "second")]
    assert line(found) == (
        "with reach and aim from t = 0 to 1.5 s: first; second; likewise with the tasks from t = 2 and 3 s on"
    )
    assert line([Finding("said", {"text": "whole"})]) == "whole"


# Trials of a shorter dt

UNSTABLE = {"resolver.alpha": 400.0, "dt": 0.01, "duration": 2.0}
#: It misses whatever dt, by a wrong gain of its resolver, which a linearisation does not show.
MISSED = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.5], gain=5.0)


@pytest.fixture
def trials(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The dt that are tried."""
    tried: list[float] = []
    own = Trials._try

    def counted(self: Trials, dt: float, most: int) -> Any:
        tried.append(dt)
        return own(self, dt, most)

    monkeypatch.setattr(Trials, "_try", counted)
    return tried


def missed(robot: nmm.Robot, target: Any = (2.0, 0.5)) -> nmm.Trajectory:
    slow = nmm.CallableResolver(lambda problem: 0.3 * np.linalg.pinv(problem.J) @ problem.rate)
    task = nmm.Task(nmm.Position("ee", "xy"), target, gain=5.0)
    return nmm.simulate(nmm.Controller(robot, task, slow), {"q2": 0.7}, 1.0, 0.01)


def test_nothing_is_tried_before_somebody_reads(robot_2r: nmm.Robot, trials: list[float]) -> None:
    run = missed(robot_2r)
    assert run.outcome is nmm.Outcome.MISSED
    assert not run.complete
    assert trials == []
    assert run.message.startswith("the error left its expected decay")
    assert 0 < len(trials) <= 6
    count = len(trials)
    assert run.summary()["message"] == run.message
    assert run.warnings is not None
    assert len(trials) == count


def test_the_outcome_is_tried_for_where_it_depends_on_it(trials: list[float]) -> None:
    changes = {"resolver.alpha": 400.0, "duration": 2.0, "method": "euler"}
    made = nmm.Scenario.load("unicycle_2r_pointing", changes).run()
    assert trials == []
    assert made.outcome is nmm.Outcome.UNSTABLE
    assert trials
    count = len(trials)
    assert the(made, "dt_too_long").values["tried"]["dt"] == trials[-1]
    assert len(trials) == count


def test_a_copy_a_pickle_and_a_folder_have_the_verdict(tmp_path: Path) -> None:
    def made() -> nmm.Trajectory:
        run = nmm.Scenario.load("unicycle_2r_position", UNSTABLE).run()
        assert isinstance(run.verdict, Awaited)
        return run

    expected = made()
    found = expected.findings, expected.message, expected.warnings, expected.outcome
    assert "tried" in the(expected, "dt_too_long").values
    verdict = pickle.loads(pickle.dumps(made().verdict))
    assert (verdict.outcome, verdict.reasons) == (expected.outcome, expected.verdict.reasons)
    for other in (copy.copy(made()), nmm.Trajectory.load(made().save(tmp_path / "run", figures=False))):
        assert (other.findings, other.message, other.warnings, other.outcome) == found
    assert copy.deepcopy(made().verdict).warnings == expected.verdict.warnings


def test_a_target_that_has_changed_since_is_not_tried(robot_2r: nmm.Robot, trials: list[float]) -> None:
    target = nmm.LiveTarget([2.0, 0.5])
    run, other = missed(robot_2r, target), missed(robot_2r, target)
    assert run.message
    assert trials
    trials.clear()
    target.set([1.0, 1.0])
    assert other.message == line(other.verdict.reasons)
    assert why(other)[0] == "promise_left"
    assert trials == []


def test_who_reads_does_not_disturb_the_controller(robot_2r: nmm.Robot) -> None:
    slow = nmm.CallableResolver(lambda problem: 0.3 * np.linalg.pinv(problem.J) @ problem.rate)
    controller = nmm.Controller(robot_2r, MISSED, slow)
    run = nmm.simulate(controller, {"q2": 0.7}, 1.0, 0.01)
    controller.dt = 0.02
    before = controller(0.3, run.q[3])
    assert run.message
    assert controller.dt == 0.02
    np.testing.assert_array_equal(controller.last(0.3, run.q[3]).u, before)


def test_an_interrupt_while_it_is_tried_is_one(robot_2r: nmm.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python code that reads the verdict is interrupted, as by any other call; a command says what it has."""

    def interrupted(self: Trials) -> None:
        raise KeyboardInterrupt

    run = missed(robot_2r)
    with monkeypatch.context() as patched:
        patched.setattr(Trials, "advice", interrupted)
        with pytest.raises(KeyboardInterrupt):
            _ = run.message
        scenario = nmm.Scenario.load("unicycle_2r_position", UNSTABLE)
        ended = commands._run(scenario, scenario.controller())
        assert (ended.outcome, why(ended)) == (nmm.Outcome.INTERRUPTED, ["interrupted_judging"])
        assert len(ended) > 1
    assert run.message.startswith("the error left")


def test_an_interrupt_while_a_run_is_judged_leaves_its_motion(
    robot_2r: nmm.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("nmm.motion.diagnosis.judgement.assess", interrupted)
    run = missed(robot_2r)
    assert (run.outcome, len(run)) == (nmm.Outcome.INTERRUPTED, 101)
    assert why(run) == ["interrupted_judging"]


# Folders


def test_summary_json_has_codes_and_values(robot_2r: nmm.Robot, tmp_path: Path) -> None:
    run = missed(robot_2r)
    folder = run.save(tmp_path / "run", figures=False)
    numbers = json.loads((folder / "summary.json").read_text("utf-8"))
    reasons = [one for one in numbers["findings"] if one["line"] == "message"]
    assert [one["code"] for one in reasons] == why(run)
    assert "; ".join(one["text"] for one in reasons) == numbers["message"] == run.message
    assert {one["line"] for one in numbers["findings"]} - {"message"} == {
        f"warnings.{i}" for i in range(len(numbers["warnings"]))
    }
    loaded = nmm.Trajectory.load(folder)
    assert loaded.findings == run.findings
    assert loaded.summary()["findings"] == numbers["findings"]


def test_folders_of_other_versions_keep_their_sentences(robot_2r: nmm.Robot, tmp_path: Path) -> None:
    folder = missed(robot_2r).save(tmp_path / "run", figures=False)
    path = folder / "summary.json"
    numbers = json.loads(path.read_text("utf-8"))
    older = {key: value for key, value in numbers.items() if key != "findings"}
    path.write_text(json.dumps(older), encoding="utf-8")
    loaded = nmm.Trajectory.load(folder)
    assert {one.code for one in loaded.findings} == {"said"}
    assert (loaded.message, list(loaded.warnings)) == (numbers["message"], numbers["warnings"])
    newer = [
        {"code": "not_known_yet", "values": {"a": 1}, "where": {}, "text": "what is new", "line": "message"}
    ]
    path.write_text(json.dumps(older | {"findings": newer}), encoding="utf-8")
    assert nmm.Trajectory.load(folder).message == "what is new"
    whole = {"initial": 1.0, "end": 2.0, "errors": []}
    for values, where in (  # of a code that is known
        ({}, {"t": 0.5}),
        (whole | {"errors": ["no mapping"]}, {"t": 0.5}),
        (whole, {"t": 0.5, "leg": {"start": 0.0}}),
    ):
        unlike = newer[0] | {"code": "promise_left", "values": values, "where": where}
        path.write_text(json.dumps(older | {"findings": [unlike]}), encoding="utf-8")
        (kept,) = nmm.Trajectory.load(folder).findings
        assert (kept.code, str(kept)) == ("said", "what is new")
    newer[0]["values"] = 3  # type: ignore[assignment]
    path.write_text(json.dumps(older | {"findings": newer}), encoding="utf-8")
    with pytest.raises(nmm.InputError, match=r"findings\.0\.values"):
        nmm.Trajectory.load(folder)


def test_every_code_is_documented(pytestconfig: pytest.Config) -> None:
    page = (pytestconfig.rootpath / "docs" / "api" / "findings.md").read_text("utf-8")
    first = [
        row.split("|")[1] for row in page.partition("## Of a robot")[0].splitlines() if row.startswith("| `")
    ]
    assert {code for cell in first for code in re.findall(r"`(\w+)`", cell)} == {
        *run.WORDS,
        *loop.WORDS,
        *bag.WORDS,
        *calibrating.WORDS,
        *log_findings.WORDS,
        *arm.WORDS,
    }
