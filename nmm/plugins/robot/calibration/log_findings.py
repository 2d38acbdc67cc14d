"""What reading the log of a drive found (`nmm.DriveLog`)."""

from nmm.base.findings.finding import Words

WORDS: dict[str, Words] = {
    "row_cut": "the last line of {file} lacks its end, and is left out",
    "rows_left_out": "{count:count row} of {of} of {file} left out: no number in {names:and}",
    "stamps_twice": "{count:count row} of {file} left out: the next has the same stamp, first in line {line}",
    "turns_counted_on": "{names:and} {names:plural begins|begin} anew: counted on (wrapped= says so, or that "
    "{names:plural it counts|they count} on {names:plural itself|themselves})",
    "counter_leaps": "{name} goes faster than it can {count:count time}, first by {by:.3g} at t = {t:.6g} s",
}
