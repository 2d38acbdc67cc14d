"""What a calibration of an arm found (`nmm.calibrate` by `nmm.Sightings`)."""

from nmm.base.findings.finding import Words

WORDS: dict[str, Words] = {
    "not_seen": "{names:few} {names:plural stays|stay}: the sightings do not show {names:plural it|them}, "
    "or not apart from others; to show {names:plural it|them}, {motion}",
    "board_turned": "{log}: {count} of {all:count picture} left out {count:plural has|have} the board's "
    "corners from its other end, first sample {sample}: tell all of them from the same end",
    "joints_count_back": "{names:and} {names:plural counts|count} the other way than in the file: ratio -1",
    "arm_far_from_file": "{name} is {value:.4g} {unit} where it was {before:.4g}: farther than arms "
    "are made; another joint's zero, or another file?",
    "postures_left_out": "{count:count posture} of {of} left out: {why}",
    "looks_few": "in {count:count posture} of {of} what is seen comes fewer than {few} times: whether it "
    "stands there is hardly to be told",
    "stamps_apart": "stamps of {topic} and of the joint states are {s:.2g} s apart, by when they came: it is "
    "slow to come, or clocks are apart",
    "platform_untold": "nothing tells whether the platform stood ({why})",
    "platform_unseen": "nothing tells where the platform was in {count:count posture} of {of}",
    "platform_shifts": "the platform moved by up to {m:.2g} m and {rad:.2g} rad between postures: what is "
    "seen is off by as much, unless that is noise",
    "samples_left_out": "{log}: {count:count sample} of {all} left out, which no noise explains, first "
    "sample {sample}",
    "corners_left_out": "{log}: {count:count corner} of {all} left out, which no noise explains, first in "
    "sample {sample}",
    "base_seems_moved": "{log}: from sample {sample} on all stands elsewhere, as if the base or what "
    "stands in the world had moved, a joint had slipped or what sees was "
    "knocked: calibrate by the samples on one side of it (of the arm as it is now: by those behind it), or "
    "say where the base stood (base=)",
    "arm_not_white": "what is left goes together from sample to sample (p = {p:.2g}): more is wrong than "
    "these numbers (links that bend, gears that are not round), and deviations are too small",
    "arm_not_better": "of {samples:count sample} that {samples:plural was|were} not learned from, the new "
    "numbers: {verdict} ({after:.3g} {unit} off after {before:.3g}, p = {p:.2g})",
    "arm_no_held_out": "there are too few samples for a part of them to be held out",
    "arm_noisy": "{log}: what is left of a sighting is {noise:.3g} {unit}, more than trackers and cameras "
    "are off: a gear that counts the other way, something that moved, or another robot's file?",
    "arm_exact": "{log}: what is left of a sighting is {noise:.1g} m, less than anything sees: is it "
    "computed from the joints' own readings, as a driver's tool pose is?",
    "arm_noise_apart": "{log}: what is left of a sighting is {noise:.3g} {unit}, and {least:.3g} in {other}: "
    "does what has one name stand elsewhere in it?",
    "many_left_out": "{log}: {percent:.0f} % was left out, which no noise explains: much is wrong with what "
    "was seen, and the deviations do not know it",
    "arm_scaled": "all lengths are {percent:.2g} % {longer} than before: is the board's size right, or the "
    "tracker's scale?",
    "arm_changed": "of {samples:count sample} that {samples:plural was|were} not learned from, {lost} "
    "{lost:plural is|are} off as no noise explains, half of all {times:.2g} times as far as the first ones "
    "leave: a joint slipped, what sees was knocked, or the first show too little",
}
