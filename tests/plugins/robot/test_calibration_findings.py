"""The sentences of a calibration's findings, once each."""

from __future__ import annotations

from typing import Any

import pytest

import nmm
from nmm.plugins.robot.calibration.findings import WORDS

HELD_OUT = {
    "windows": 15,
    "length": 2.2,
    "before": 0.008,
    "after": 0.0085,
    "p": 0.4,
    "verdict": "no difference",
}
TRACK = {"name": "track", "value": 0.5, "unit": "m"}
EXAMPLES: list[tuple[str, dict[str, Any], dict[str, Any], str]] = [
    ("not_shown", TRACK | {"others": [], "motion": "turn on the spot"}, {},
     "track stays at 0.5 m: the drives do not show it; to show it, turn on the spot"),
    ("not_shown", TRACK | {"others": ["a", "b"], "motion": "turn"}, {},
     "track stays at 0.5 m: the drives do not show it, or not apart from a and b; to show it, turn"),
    ("scale_held", {}, {},
     "drives that end where they began do not show how long all lengths are: the mean radius "
     "stays; to show it, drive between two marks, and tell their distance"),
    ("far_from_file", {"name": "radius.left", "value": 0.25, "before": 0.1, "unit": "m"}, {},
     "radius.left is 0.25 m where the file has 0.1: another gear, or other ticks a turn?"),
    ("of_the_log", {"names": ["scale.v", "scale.omega"]}, {},
     "scale.v and scale.omega are of the log's own counts, no "
     "numbers of the robot: an odometry takes them as slip="),
    ("counters_silent", {"log": "a.csv", "count": 2}, {},
     "a.csv: the encoders said nothing for long 2 times: begun anew after it"),
    ("looks_left_out", {"log": "a.csv", "count": 1, "all": 600}, {"t": 3.0},
     "a.csv: 1 look of 600 of the reference left out, which no noise explains, first at 3 s"),
    ("reference_jumped", {"log": "a.csv", "count": 1}, {"t": 3.0},
     "a.csv: the reference jumped 1 time, first at 3 s: begun anew there"),
    ("reference_twisted", {"log": "a.csv from 3 s", "by": 0.3}, {"t": 3.0},
     "a.csv from 3 s: the reference's heading jumped, 0.3 rad beside the rest, and its "
     "place did not: its headings are not used there"),
    ("looks_thinned", {"log": "a.csv", "every": 3, "count": 200}, {},
     "a.csv: one of 3 looks of the reference is used, 200 in all"),
    ("not_white", {"p": 1e-5}, {},
     "what is left is no white noise (p = 1e-05): more is wrong than these numbers, or "
     "other noise than of wheels and reference; deviations are too small then"),
    ("not_better", HELD_OUT, {},
     "over 15 windows of 2.2 m that were not learned from, dead reckoning by the new "
     "numbers: no difference (0.0085 m off after 0.008 m, p = 0.4)"),
    ("no_held_out", {}, {}, "the drives are too short for a part of them to be held out"),
    ("size_or_clock", {"by": 11.1, "larger": True, "clock": 10.0}, {},
     "wheels seem 11 % larger: steady motion does not tell that from a reference's clock that runs 10 % "
     "slow; to tell them apart, speed up and slow down"),
    ("clocks_apart", {"log": "a.csv", "rate": 18.0, "faster": False, "apart": 30.0}, {},
     "a.csv: the reference's clock runs 18 ms a minute slower than the encoders': 30 ms over the drive"),
]  # fmt: skip


@pytest.mark.parametrize(("code", "values", "where", "sentence"), EXAMPLES)
def test_a_finding_is_a_sentence(
    code: str, values: dict[str, Any], where: dict[str, Any], sentence: str
) -> None:
    assert str(nmm.Finding(code, values, where)) == sentence


def test_every_code_has_an_example() -> None:
    assert {code for code, *_ in EXAMPLES} == WORDS.keys()
