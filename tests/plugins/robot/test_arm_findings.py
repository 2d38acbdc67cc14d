"""The sentences of what an arm's calibration finds, once each."""

from __future__ import annotations

from typing import Any

import pytest

import nmm
from nmm.plugins.robot.calibration.arm.findings import WORDS

HELD_OUT = {
    "samples": 12,
    "unit": "m",
    "before": 0.004,
    "after": 0.0041,
    "p": 0.4,
    "verdict": "no difference",
}
EXAMPLES: list[tuple[str, dict[str, Any], str]] = [
    ("not_seen", {"names": ["offset.q4"], "motion": "move q4 by more"},
     "offset.q4 stays: the sightings do not show it, or not apart from others; to show it, move q4 by more"),
    ("not_seen", {"names": ["offset.q4", "origin.q3.z"], "motion": "move q4 and q3 by more"},
     "offset.q4, origin.q3.z stay: the sightings do not show them, or not apart from others; to show them, "
     "move q4 and q3 by more"),
    ("board_turned", {"log": "a.csv", "count": 1, "all": 1, "sample": 3},
     "a.csv: 1 of 1 picture left out has the board's corners from its other end, first sample 3: tell all of "
     "them from the same end"),
    ("board_turned", {"log": "a.csv", "count": 13, "all": 14, "sample": 3},
     "a.csv: 13 of 14 pictures left out have the board's corners from its other end, first sample 3: tell "
     "all of them from the same end"),
    ("joints_count_back", {"names": ["q2"]}, "q2 counts the other way than in the file: ratio -1"),
    ("arm_far_from_file", {"name": "offset.q2", "value": 0.5, "before": 0.0, "unit": "rad"},
     "offset.q2 is 0.5 rad where it was 0: farther than arms are made; another joint's zero, or "
     "another file?"),
    ("postures_left_out", {"count": 1, "of": 40, "why": "nothing is seen"},
     "1 posture of 40 left out: nothing is seen"),
    ("samples_left_out", {"log": "a.csv", "count": 2, "all": 40, "sample": 17},
     "a.csv: 2 samples of 40 left out, which no noise explains, first sample 17"),
    ("corners_left_out", {"log": "a.csv", "count": 1, "all": 900, "sample": 3},
     "a.csv: 1 corner of 900 left out, which no noise explains, first in sample 3"),
    ("base_seems_moved", {"log": "a.csv", "sample": 25},
     "a.csv: from sample 25 on all stands elsewhere, as if the base or what stands in the world had moved, "
     "a joint had slipped or what sees was knocked: calibrate by the samples on one side of it (of the arm "
     "as it is now: by those behind it), or say where the base stood (base=)"),
    ("arm_not_white", {"p": 1e-4},
     "what is left goes together from sample to sample (p = 0.0001): more is wrong than these numbers "
     "(links that bend, gears that are not round), and deviations are too small"),
    ("arm_not_better", HELD_OUT,
     "of 12 samples that were not learned from, the new numbers: no difference (0.0041 m off after 0.004, "
     "p = 0.4)"),
    ("arm_no_held_out", {}, "there are too few samples for a part of them to be held out"),
    ("arm_noisy", {"log": "a.csv", "noise": 0.0109, "unit": "m"},
     "a.csv: what is left of a sighting is 0.0109 m, more than trackers and cameras are off: a gear that "
     "counts the other way, something that moved, or another robot's file?"),
    ("arm_exact", {"log": "a.csv", "noise": 1.04e-7},
     "a.csv: what is left of a sighting is 1e-07 m, less than anything sees: is it computed from the joints' "
     "own readings, as a driver's tool pose is?"),
    ("arm_noise_apart", {"log": "b.csv", "noise": 0.001, "unit": "m", "least": 1e-4, "other": "a.csv"},
     "b.csv: what is left of a sighting is 0.001 m, and 0.0001 in a.csv: does what has one name stand "
     "elsewhere in it?"),
    ("many_left_out", {"log": "a.csv", "percent": 40.0},
     "a.csv: 40 % was left out, which no noise explains: much is wrong with what was seen, and the "
     "deviations do not know it"),
    ("arm_scaled", {"percent": 3.19, "longer": "longer"},
     "all lengths are 3.2 % longer than before: is the board's size right, or the tracker's scale?"),
    ("arm_changed", {"samples": 15, "lost": 10, "times": 3.83},
     "of 15 samples that were not learned from, 10 are off as no noise explains, half of all 3.8 times as "
     "far as the first ones leave: a joint slipped, what sees was knocked, or the first show too little"),
    ("looks_few", {"count": 3, "of": 12, "few": 6},
     "in 3 postures of 12 what is seen comes fewer than 6 times: whether it stands there is hardly to be "
     "told"),
    ("stamps_apart", {"topic": "/marker", "s": 0.512},
     "stamps of /marker and of the joint states are 0.51 s apart, by when they came: it is slow to come, or "
     "clocks are apart"),
    ("platform_untold", {"why": "no odometry"}, "nothing tells whether the platform stood (no odometry)"),
    ("platform_unseen", {"count": 1, "of": 12},
     "nothing tells where the platform was in 1 posture of 12"),
    ("platform_shifts", {"m": 0.0123, "rad": 0.004},
     "the platform moved by up to 0.012 m and 0.004 rad between postures: what is seen is off by as much, "
     "unless that is noise"),
]  # fmt: skip


@pytest.mark.parametrize(("code", "values", "sentence"), EXAMPLES)
def test_a_finding_is_a_sentence(code: str, values: dict[str, Any], sentence: str) -> None:
    assert str(nmm.Finding(code, values)) == sentence


def test_every_code_has_an_example() -> None:
    assert {code for code, *_ in EXAMPLES} == WORDS.keys()
