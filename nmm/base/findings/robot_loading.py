"""What loading a robot changed, and what is odd about its wheels, platform, mimic joints and SRDF."""

from collections.abc import Mapping, Sequence

from nmm.base.errors import few
from nmm.base.findings.robot_file import placed
from nmm.base.text_format import apart, listed

#: Why a presumed wheel joint is none, by `why`.
NO_WHEEL = {
    "not_turning": "it does not turn",
    "joint_below": "another joint is below it",
    "axis_not_level": "its axis is not level",
    "platforms_own": "it is the platform's own",
    "not_on_root": "another joint is between it and the root link",
    "joint_between": "another joint is between it and the root link ({between}); lock that to make it one",
    "swivel_carries_more": "{swivel}, on which it would swivel, carries {other} too",
}


def _reference_moved(*, at: Sequence[float], yaw: float, **_: object) -> str:
    turned = f", turned by {yaw:g} rad" if abs(yaw) > 1e-9 else ""
    return (
        f"the platform's reference point is at ({', '.join(f'{x:g}' for x in at)}) m in the root link{turned}"
    )


#: What helps wheels on several axles, by the way they roll (`roll`).
_ROLLING = {
    "ahead": "on several axles they cannot all roll in turns: --platform skid_steer "
    '(platform="skid_steer") is made for that, '
    "mecanum or omnidirectional for wheels with rollers",
    "aside": "they do not roll along the x axis: --axle X,Y,Z,YAW (axle=[...]) gives the direction, or leave "
    "axle and platform to the file",
    "apart": 'they are not parallel: with rollers, --platform omnidirectional (platform="omnidirectional")',
}


def _wheels_slide(
    *, platform: str, speeds: Mapping[str, float], several_axles: bool, roll: str = "ahead", **_: object
) -> str:
    names = few([f"{name} ({speed:.3g} m/s for an input of 1)" for name, speed in speeds.items()])
    why = _ROLLING[roll]
    if roll == "ahead" and not several_axles:
        why = "is its reference point on their axle? (axle, --axle X,Y)"
    return f"wheels slide sideways under platform {platform}: {names}; {why}"


def _base_of_joints(
    *, names: Sequence[str], platform: str, limits: Mapping[str, Sequence[float]] | None = None, **_: object
) -> str:
    base = f"{', '.join(names)} move the whole robot{'' if limits else ' without limits'}: a base of joints, "
    if platform == "fixed":
        return f"{base}coordinates like others"
    ends = few([f"{name} from {low:g} to {high:g}" for name, (low, high) in (limits or {}).items()])
    left_out = f", without their limits ({ends})" if limits else ""
    return f"{base}in whose place is platform {platform}{left_out}; platform fixed keeps them as coordinates"


def _posture_beyond(*, posture: str, beyond: Mapping[str, Sequence[float]], **_: object) -> str:
    far = ["{} = {} (from {} to {})".format(name, *apart(*three, digits=6)) for name, three in beyond.items()]
    return f"posture {posture} is outside limits: {few(far)}"


#: Why the wheels are those of the platform taken, by `why`.
_RECOGNIZED = {
    "axes_meet": "the axes of {names} are not parallel: they have rollers",
    "rollers": "{names} have rollers",
    "driven_so": "the file's plugin or name says that {names} have rollers",
    "hitched": "wheels hang behind {names}",
    "steered": "{names} steer, otherwise than a car's",
    "several_axles": "{names} stand on several axles and do not steer, so that they slide in turns; with "
    'rollers: --platform mecanum (platform="mecanum")',
    "all_steered": "all wheels are on upright joints ({names}), which turn them anywhere; --platform wheeled "
    '(platform="wheeled") has these angles as coordinates',
}
#: Why wheels do not say what platform they are of, by `why`.
_UNCLEAR = {
    "on_swivels": "all wheels swivel freely: {names}",
    "not_parallel": "wheels that neither steer nor swivel are not parallel: {names}",
    "several_axles": "wheels on several axles, neither in pairs nor steered: {names}",
    "steered_otherwise": "what steers fits no platform with these wheels: {names}",
    "size_unknown": "platform skid_steer needs all radii, --wheels NAME=METRES,...: {names}",
    "rollers_in_line": "wheels with rollers that cannot move it every way: {names}",
}


def _platform_recognized(*, platform: str, why: str, names: Sequence[str], **_: object) -> str:
    return f"platform {platform} by its wheels: {_RECOGNIZED[why].format(names=few(names, shown=4))}"


def _platform_unclear(*, why: str, names: Sequence[str], commands: Sequence[str], **_: object) -> str:
    options = listed(commands[:3], "or")
    return (
        f"the wheels do not tell the platform: {options}? {_UNCLEAR[why].format(names=few(names, shown=4))}"
    )


WORDS = placed(
    {
        # ------------------------------------------------------------------ what loading did
        "root_replaced": "root joint {name} ({kind}) replaced by x, y, theta",
        "continuous_joints": "continuous joints as one unbounded angle each: {names:few}",
        "joint_added": "{name} is no joint of the file: the angle of a wheel midway between those that "
        "steer, which follow it (Ackermann)",
        "joints_reversed": "axes that point down turned upwards, since a platform's angles count to the "
        "left: {names:few}; angles and limits have the other sign",
        "calibrated": lambda *, numbers, **_: (
            "not as its file says: "
            + few([f"{name} {own:g} (file: {file:g})" for name, (file, own) in numbers.items()], shown=6)
        ),
        "reference_moved": _reference_moved,
        "joints_locked": "locked joints: {values:few %s at %g}",
        "mimics_locked": lambda *, values, **_: (
            "locked with the joint that they follow: "
            + few([f"{name} at {at:g} (follows {leader})" for name, (leader, at) in values.items()])
        ),
        "mimic_joints": "joints that follow others, without an input: {names:few}",
        "mimics_of_ground": "turned by the ground, not by the joint that they follow: {names:few}",
        "wheels_left_out": "wheels that only roll, left out of q: {names:few}",
        "swivels_left_out": "joints that steer them or swivel, left out of q: {names:few}",
        "wheels_held": "wheels of a fixed base, which stand still: {names:few}",
        "not_a_wheel": lambda *, name, why, **values: (
            f"{name} stays a coordinate in spite of its name: {NO_WHEEL[why].format(**values)}"
        ),
        "taken_for_casters": lambda *, names, **_: (
            f"each turns a wheel about an upright axis through it and is taken for a caster: {few(names)}; "
            f"if they steer: --steer {','.join(names[:2])} (steer={[*names[:2]]!r})"
        ),
        "no_wheel": lambda *, name, why, **values: (
            f"joint {name!r} is no wheel: {NO_WHEEL[why].format(**values)}"
        ),
        "radius_unknown": lambda *, names, **_: (
            f"nothing tells the radius of wheels {few(names)}: they stand still in playback, and limit no "
            f"speed; give it, --wheels {names[-1]}=METRES,... (wheels={{{names[-1]!r}: ...}})"
        ),
        "platform_recognized": _platform_recognized,
        "platform_unclear": _platform_unclear,
        "wheels_fixed": "links that are called wheels do not turn in the file ({names:few}): its root is "
        "taken for a unicycle, --platform for another",
        "no_wheels": "no wheels in the file{names:if  that roll ({names:few} cannot)}: its root link is "
        "taken for a unicycle; --platform for another, --platform fixed for an arm that stands",
        "wheels_by_shape": "wheels by their shapes, not their names: {names:few}",
        "steering_held": "they steer, and stand still at zero: {names:few}",
        "undercarriage_held": "between the base and its wheels, standing still: {values:few %s at %g}; "
        "--lock NAME=VALUE for another place",
        "tyre_unclear": lambda *, name, middles, **_: (
            f"the shapes of wheel {name!r} disagree on the middle of its tyre, "
            f"{', '.join(f'{1e3 * value:.4g}' for value in middles)} mm along its axis from the joint: the "
            "first counts"
        ),
        "no_arm": "no arm: the platform is all that moves",
        "nothing_moves": "nothing moves",
        "collision_pairs": "{count} collision pairs: none within a body or across one joint",
        "shapes_left_out": "shapes left out, their meshes are missing: {names:few}",
        "base_of_joints": _base_of_joints,
        "accelerations_of_file": "limits of acceleration in the file, which only Limits(acceleration=...) "
        "keeps, in scenarios limits: acceleration: {limits:few %s: %g}",
        "names_taken": "renamed, since the platform's coordinates or inputs have these names: "
        "{names:few %s is %s}",
        "gantry": "{names:few} slide all else and nothing turns it: a gantry, on platform fixed; --platform "
        'NAME (platform="NAME") puts it on another',
        "arm_mounted": lambda *, name, key, frame, base, prefix, **_: (
            f"{name} mounted{f' as {key}' if key != name else ''} at {frame} of {base}"
            f"{f', its names with the prefix {prefix}' if prefix else ''}"
        ),
        # ------------------------------------------------------------------ what is odd
        "mimic_limits_ignored": "{mimic}: its limits, from {lower:g} to {upper:g}, leave {leader} no room "
        "and do not count",
        "slides_long": lambda *, rooms, **_: (
            f"slides longer than an arm's: {few([f'{name} ({room:.3g} m)' for name, room in rooms.items()])}"
            f"; if they stand for a base that moves, hold them, --lock {next(iter(rooms))}=0 "
            f"(lock={{{next(iter(rooms))!r}: 0}})"
        ),
        "wheels_slide": _wheels_slide,
        "hitch_unused": "{name} carries wheels and is called a hitch: --platform tractor "
        '(platform="tractor") has its angle for a coordinate',
        "wheel_unnamed": "joint {name!r} turns without end about a level axis, with nothing below it: if "
        "it is a wheel, say so with the others, --wheels {name},... (wheels=[{name!r}, ...]); its name "
        'holds no "wheel"',
        "ground_uneven": lambda *, heights, near, **_: (
            "the wheels do not touch one level ground: "
            + few([f"{name} at z = {z:.4g} m" for name, z in heights.items()])
            + f"; expected within {1e3 * near:.3g} mm of each other. Heights or radii are wrong, or the "
            "robot stands tilted"
        ),
        "footprint_off_ground": lambda *, frame, off, **_: (
            f"frame {frame!r} is {abs(off):.4g} m {'above' if off > 0.0 else 'below'} the ground that the "
            "wheels touch: a footprint is on it"
        ),
        "platform_misfit": "given by hand, and not what its file holds: {reason}",
        "platform_length_differs": "platform {platform}: {name} is {given:g} m as given, and "
        "{measured:.6g} m in the file",
        "wheel_radius_differs": "radius of wheel {name!r} is {given:g} m as given, and {measured:.6g} m in "
        "the file",
        "steering_too_narrow": "platform {platform} turns on the spot, for which the file's wheels would "
        "have to steer to 90 degrees; {name} ends at {lower:.4g} and {upper:.4g} degrees: platform car?",
        "moves_sideways": "platform {platform} moves sideways, which needs three wheels with rollers or "
        "more; the file's main body stands on {wheels}",
        # ------------------------------------------------------------------ an SRDF
        "srdf_unused": "not used: {reason[text]}",
        "not_srdf": lambda *, got, **_: (
            "expected an SRDF (groups, states, pairs of links), this is "
            + ("a URDF" if got == "robot" else f"<{got}>")
        ),
        "state_not_numbers": "joint {name}: expected numbers, got {got:quoted}",
        "posture_joints_unknown": "posture {posture}: no such joints: {names:few}",
        "posture_of_base": "posture {posture}: in place of {names:few} are x, y, theta: left out",
        "groups_without_inputs": "groups that move by no input: {names:few}",
        "srdf_names_unknown": "no such links, joints or groups: {names:few}",
        "virtual_joint_unused": "virtual joint {name} does not count: {child} is not the root link",
        "motion_model_differs": "virtual joint {name} has motion model {model}, unlike platform {platform}",
        "passive_held": "joints without a motor have no input and are held: {values:few %s at %g} (lock for "
        "another value)",
        "posture_not_one_number": "posture {posture}: {name}: expected one number, got {count}: left out",
        "posture_locked": "posture {posture}: {name} is locked at {locked:g}, not at {wanted:g}",
        "posture_follows": "posture {posture}: {name} follows {leader} ({mimic}), not at {wanted:g}",
        "posture_beyond": _posture_beyond,
    }
)
