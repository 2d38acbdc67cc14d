"""What a calibration found (`nmm.calibrate`)."""

from nmm.base.findings.finding import Words

WORDS: dict[str, Words] = {
    "not_shown": "{name} stays at {value:.5g} {unit}: the drives do not show it"
    "{others:if , or not apart from {others:and}}; to show it, {motion}",
    "scale_held": "drives that end where they began do not show how long all lengths are: the mean radius "
    "stays; to show it, drive between two marks, and tell their distance",
    "far_from_file": "{name} is {value:.4g} {unit} where the file has {before:.4g}: another gear, or other "
    "ticks a turn?",
    "of_the_log": "{names:and} {names:plural is|are} of the log's own counts, no numbers of the robot: an "
    "odometry takes them as slip=",
    "counters_silent": "{log}: the encoders said nothing for long {count:count time}: begun anew after it",
    "looks_left_out": "{log}: {count:count look} of {all} of the reference left out, which no noise "
    "explains, first at {t:.4g} s",
    "reference_jumped": "{log}: the reference jumped {count:count time}, first at {t:.4g} s: begun anew "
    "there",
    "reference_twisted": "{log}: the reference's heading jumped, {by:.2g} rad beside the rest, and its "
    "place did not: its headings are not used there",
    "looks_thinned": "{log}: one of {every} looks of the reference is used, {count} in all",
    "not_white": "what is left is no white noise (p = {p:.2g}): more is wrong than these numbers, or other "
    "noise than of wheels and reference; deviations are too small then",
    "not_better": "over {windows} windows of {length:.2g} m that were not learned from, dead reckoning by "
    "the new numbers: {verdict} ({after:.3g} m off after {before:.3g} m, p = {p:.2g})",
    "no_held_out": "the drives are too short for a part of them to be held out",
    "size_or_clock": "wheels seem {by:.2g} % {larger:if larger}{larger:else smaller}: steady motion does not "
    "tell that from a reference's clock that runs {clock:.2g} % {larger:if slow}{larger:else fast}; to tell "
    "them apart, speed up and slow down",
    "clocks_apart": "{log}: the reference's clock runs {rate:.3g} ms a minute "
    "{faster:if faster}{faster:else slower} than the encoders': {apart:.3g} ms over the drive",
}
