"""What reading a robot's log found (`nmm.read_bag`), or a data set (`nmm.read_lerobot`)."""

from nmm.base.findings.finding import Words

_STAMPS = {
    "zero": "has stamps of 0",
    "standing": "has stamps that stand still",
    "another clock": "is stamped by another clock than the recorder's",
}


WORDS: dict[str, Words] = {
    "bag_cut": "{file} is read as far as it goes ({reason}); to mend it: {mend}",
    "stamps_of_recording": lambda topic, why: f"{topic} {_STAMPS[why]}: it goes by the times of recording",
    "stamps_missing": "{count:count message} of {topic} without a stamp left out",
    "pose_jumps": "{edge} jumps {count:count time}, by up to {m:.3g} m and {rad:.3g} rad, first at "
    "t = {t:.4g} s: it stays until then, and no input is made of it",
    "parents_differ": "{frame} has several parents in TF: {parents}; read is {edge}",
    "rates_contradict": "{names:and} {zero:if {names:plural is|are} all 0 while q moves}{zero:else "
    "{names:plural contradicts|contradict} q}: differences of q are taken",
    "joint_silent": "{name} comes no more after t = {t:.4g} s: it stays where it was until {last:.4g} s",
    "values_not_finite": "{name} is no number in {count:count message}, left out",
    "looks_lost": "{count:count message} of {topic} without a pose left out: numbers that are none, or a "
    "quaternion of zeros",
    "child_unnamed": "{topic} does not say whose pose it is: taken for the reference point's",
    "platform_silent": "no pose of the platform from t = {t:.4g} to {end:.4g} s: a straight line in between",
    "platform_unknown": "{s:.4g} s of joint states, in which the platform's pose is not known, are left out",
    "actions_beyond": "actions ask for up to {times:.3g} times the velocity measured of the platform: q "
    "and u are of what was measured",
    "wheels_too_fast": "velocities of the platform ask wheels for {times:.3g} times their limits: another "
    "unit?",
    "velocity_impossible": "{share:.0%} of a velocity is one that {platform} cannot have: another robot's "
    "data, or another unit?",
    "joints_outside": "{names:and} {names:plural is|are} outside {names:plural its|their} limits by up to "
    "{most:.3g}: another unit, or another zero?",
}
