"""Findings in the text of a robot's file: why it cannot be loaded, and what is odd about it."""

from collections.abc import Mapping, Sequence
from functools import partial

from nmm.base.errors import SHOWN, RobotError, few, no_such
from nmm.base.findings.finding import Finding, Words, sentence
from nmm.base.text_format import apart, counted, one_line, short_words

_PACKAGE = "package {package!r} not found (give its folder in package_dirs, --package-dir)"
#: Why there is no mesh, by `cause`.
_CAUSES = {
    "file": "no such file",
    "package": _PACKAGE,
    "file_in_package": "no such file in the package",
    "scheme": "cannot read from {scheme}://",
}
#: What becomes of a missing mesh's shape, by `shape`.
_SHAPES = {
    "": "",
    "left_out": "; its shape is left out",
    "refused": ": refused unless missing_meshes='skip' (--missing-meshes skip)",
}

_COUNTS = {2: "two", 3: "three"}


def placed(table: Mapping[str, Words]) -> dict[str, Words]:
    """The same, each sentence preceded by its place: the arm, the included file, the link or joint."""

    def write(words: Words, **values: object) -> str:
        return _place(values) + sentence(words, values)

    return {code: partial(write, words) for code, words in table.items()}


def _place(values: Mapping[str, object]) -> str:
    text = f"{values['arm']}: " if "arm" in values else ""
    text += f"SRDF {values['srdf']}: " if "srdf" in values else ""
    if "file" in values:
        line = f":{values['line']}" if "line" in values else ""
        text += f"in {values['file']}{line}: "
    owners = [f"{kind} {values[kind]!r}" for kind in ("link", "joint") if kind in values]
    owners += [str(values["part"])] if "part" in values else []
    return f"{text}{', '.join(owners)}: " if owners else text


def _mesh_missing(*, mesh: str, cause: str, shape: str = "", **values: object) -> str:
    return f"mesh {mesh!r}: {_CAUSES[cause].format(**values)}{_SHAPES[shape]}"


def _only_macros(*, name: str, macros: Mapping[str, str], **_: object) -> str:
    calls = "; ".join(f"{macro} ({parameters or 'no parameters'})" for macro, parameters in macros.items())
    first = next(iter(macros)).removeprefix("xacro:")
    return (
        f"holds no robot, only macros: {one_line(calls, 120)}; write a .xacro file that includes it and "
        f"calls one: <xacro:include filename={name!r}/> <xacro:{first} .../>"
    )


def _macro_parameters_missing(*, macro: str, missing: Sequence[str], name: str, **_: object) -> str:
    if blocks := [parameter for parameter in missing if parameter.startswith("*")]:
        cure = f"{blocks[0]} is a block of elements: write a .xacro file that includes {name} and calls it"
    else:
        cure = " ".join(f"-a {parameter}=VALUE" for parameter in missing[:3])
    return f"holds no robot but one macro, {macro}, whose parameters {few(missing)} have no default: {cure}"


def _path(names: Sequence[str]) -> str:
    """Names in a row, possibly hundreds."""
    left = len(names) - SHOWN - 1
    shown = [*names[:SHOWN], f"({left} more)", names[-1]] if left > 0 else names
    return " -> ".join(shown)


def _lined(names: Sequence[str], lines: Mapping[str, int | str]) -> str:
    """Names with their lines, or FILE:LINE."""
    at = {name: f"line {line}" if isinstance(line, int) else line for name, line in lines.items()}
    return few([f"{name} ({at[name]})" if name in at else name for name in names])


def _times(count: int, values: Mapping[str, object]) -> str:
    """How often, and where first."""
    line = f"line {values['line']}" if "line" in values else ""
    often = f"{count} times{', first in ' if line else ''}" if count > 1 else ""
    return f" ({often}{line})" if often or line else ""


def _unknown(
    *, element: str, near: str, count: int, inside: str = "", attribute: str = "", **values: object
) -> str:
    what = f"<{element}> {attribute}" if attribute else f"<{element}> in <{inside}>"
    meant = f": did you mean {near}?" if near else ""
    return f"{what}{_times(count, values)} is not known and does not count{meant}"


def _soft_limits(*, limits: Mapping[str, Sequence[float]], count: int, **values: object) -> str:
    soft = [f"{name}: [{low:g}, {high:g}]" for name, (low, high) in limits.items()]
    return (
        f"soft limits of <safety_controller>{_times(count, values)} are not kept: {few(soft)}; they are "
        "where given as limits of position (Limits(position=...))"
    )


def _unread(*, element: str, why: str, count: int, attribute: str = "", **values: object) -> str:
    what = f"<{element}> {attribute}" if attribute else f"<{element}>"
    return f"{what}{_times(count, values)} is not read: {why}"


WORDS = placed(
    {
        # ------------------------------------------------------------------ a text that is no description
        "file_empty": "the file is empty",
        "file_unreadable": "cannot be read ({reason})",
        "not_text": "not UTF-8 text",
        "not_xml": "not well-formed XML: {reason}",
        "doctype": "holds a DOCTYPE, which is refused (entities are not expanded)",
        "nested_too_deep": "elements stand more than {most} deep in one another",
        "not_robot": "expected <robot> (URDF) or <mujoco> (MJCF) as the root element, got <{got}>",
        "mjcf_unread": "{what} is not understood, so nothing is read",
        "mjcf_included_twice": "included twice",
        "mjcf_several_trees": "expected one robot, found {names:number} bodies of the world that move: "
        "{names:few}{fused:if ; if MuJoCo saved it from a URDF: its root link became the world's, which "
        '<compiler fusestatic="false"/> in the <mujoco> of the URDF prevents}',
        "mjcf_left_out": lambda *, names, lines=(), **_: (
            f"left out of the MJCF file: {_lined(names, dict(lines))}"
        ),
        "mjcf_noted": lambda *, why, names, lines, **_: f"MJCF: {_lined(names, lines)}: {why}",
        "mjcf_keyframe": "keyframe {name!r} has {got} numbers as qpos, the robot has {size}: left out",
        "mjcf_speeds": "velocities are limited by what actuators may ask for: {limits:few %s %g} (rad/s, "
        "m/s)",
        "mjcf_efforts": "efforts are limited by what actuators give: {limits:few %s %g} (Nm, N)",
        "mjcf_controls": "actuators ask for less than the joints' limits, which are kept: "
        "{ranges:few %s from %g to %g}",
        "beyond_bound": "more than {most:,.0f} {what}: no robot needs as many",
        "xacro_left_over": "<{element}/> is left over from xacro: left out",
        "only_macros": _only_macros,
        "macro_parameters_missing": _macro_parameters_missing,
        "xacro_failed": "xacro: {reason}",
        "xacro_untrusted": "xacro: {what}: expected arithmetic, xacro's functions, the robot's own files; if "
        "you trust the author: --trust (trust=True)",
        "xacro_argument_missing": "xacro argument {name!r} has no default and was not given a value",
        "xacro_endless": "xacro: files or macros too deep in one another (does one include or call itself?)",
        "xacro_warned": "xacro {text}",
        "package_missing": f"{{by}}: {_PACKAGE}{{searched:if ; looked in {{searched:all}}}}",
        "found_nearby": lambda *, count, name, place, **_: (
            f"{name} leads nowhere, and was found near the file, at {place}"
            + (f"; so were {counted(count - 1, 'other')}" if count > 1 else "")
        ),
        "refused": "{text}",
        "library_failed": "cannot be loaded: {error}: {reason}",
        # ------------------------------------------------------------------ names, and the tree
        "version_unknown": "<robot> version: expected 1.0, 1.1 or 1.2, got {got!r}",
        "no_links": "no links (in MJCF: no bodies)",
        "name_missing": "a {kind} without a name",
        "name_twice": "two {kind}s named {name!r}",
        "name_unknown": lambda *, kind, got, available, **_: str(no_such(kind, got, available)),
        "two_parents": "link {name!r} has two parents: {parents:few %r}",
        "cycle": lambda *, links, **_: f"the links form a cycle: {_path(links)}",
        "several_roots": lambda *, roots, **_: (
            f"expected one root link, found {_COUNTS.get(len(roots), len(roots))}: {few(roots)}"
        ),
        "leader_unknown": "follows {leader!r}, which is no joint: it moves by itself, with its own input",
        "faults_spared": "{count} faults that kinematics does not feel, first: {first} (all: nmm check)",
        "mimic_cycle": lambda *, joints, **_: f"<mimic> follows itself: {_path(joints)}",
        "platform_twice": "a second <nmm>, expected one",
        # ------------------------------------------------------------------ elements and attributes
        "element_missing": "<{element}> has no <{missing}>",
        "attribute_missing": "<{element}> has no {attribute}",
        "not_numbers": "<{element}> {attribute}: expected {count:plural a finite number|{count} finite "
        "numbers}, got {got:quoted}",
        "below_minimum": "<{element}> {attribute}: expected {minimum:g} or more, got {got:g}",
        "negative_length": "<{element}> {attribute}: expected lengths of 0 or more (m), got {got:quoted}",
        "colour_beyond": "<color> rgba: expected numbers from 0 to 1, got {got:quoted}",
        "shape_missing": "no shape (expected <geometry> with one of {available:all})",
        "mesh_missing": _mesh_missing,
        "mesh_unreadable": "mesh {mesh} cannot be read: {reason}",
        "mesh_format_unknown": "mesh {mesh!r}: unknown format, expected {available:all}",
        "joint_type_missing": "no type, expected one of {available:all}",
        "joint_helical": "a {kind} joint is refused: it turns and slides at once; expected one of "
        "{available:all}",
        "base_inside_tree": "a {kind} joint is refused inside the tree: it stands for the platform's x, y "
        "and theta only where it is the one movable joint on the root link's body",
        "base_tilted": "<axis> of a planar joint: expected it upright, 0 0 1, got {axis[0]:g} {axis[1]:g} "
        "{axis[2]:g}",
        "axis_zero": "<axis> xyz is zero: {got!r}",
        "limit_missing": "a {kind} joint needs a <limit>, this one has none",
        "limits_crossed": lambda *, lower, upper, **_: "<limit> lower {} is above upper {}".format(
            *apart(lower, upper, digits=6)
        ),
        "turned_twice": "<origin> has both rpy and quat_xyzw, expected one of them",
        "quaternion_zero": "<origin> quat_xyzw is zero: no rotation has it",
        # ------------------------------------------------------------------ what does not count
        "element_unknown": _unknown,
        "attribute_unknown": _unknown,
        "element_unread": _unread,
        "attribute_unread": _unread,
        "element_again": lambda *, element, inside, count, **values: (
            f"a further <{element}> in one <{inside}>{_times(count, values)} does not count: the first does"
        ),
        "soft_limits": _soft_limits,
        "limits_of_continuous": lambda *, names, count, **values: (
            f"<limit> lower and upper{_times(count, values)} do not count at continuous joints: {few(names)}"
        ),
        "dynamics_empty": "<dynamics> has neither damping nor friction",
        # ------------------------------------------------------------------ what is odd
        "mass_large": "a mass of {mass:g} kg: is that meant?",
        "mass_missing": "no mass, but moments of inertia",
        "inertia_missing": "a mass of {mass:g} kg, but no moments of inertia",
        "inertia_indefinite": "inertia is not positive definite: principal moments {moments:all %.3g} kg m^2",
        "inertia_impossible": "no body has this inertia: of the principal moments {moments:all %.3g} kg m^2 "
        "the largest is above the sum of the others",
        "body_without_mass": "moves with joint {moved_by!r} and has no {inertial:if mass}"
        "{inertial:else <inertial>}, nor has any link fixed to it: dynamics and centre of mass leave it out",
        "velocity_unlimited": "no <limit>, so no limit of its velocity",
        "velocity_zero": "<limit> velocity is 0, which is taken as no limit",
        "joint_held": "<limit> lets it stand at {value:g} only (both ends are 0 unless given)",
        "limits_large": "<limit> from {lower:g} to {upper:g} rad: degrees?",
        "rpy_large": "<origin> rpy {rpy[0]:g} {rpy[1]:g} {rpy[2]:g} rad: degrees?",
        "name_shared": "a link has that name, too: as a frame, it means the link",
    }
)


#: Most findings in one error.
MOST_NAMED = 12


def refusal(file: object, *findings: Finding, lines: bool = True) -> RobotError:
    """A one-line error with at most `MOST_NAMED` findings; `lines`: their line numbers are the file's own."""
    shown = []
    for finding in findings[:MOST_NAMED]:
        line = line_of(finding) if lines else None
        text = one_line(short_words(str(finding)), 1000)
        shown.append(text if line is None else f"line {line}: {text}")
    shown += [f"and {len(findings) - MOST_NAMED} more"] if len(findings) > MOST_NAMED else []
    return RobotError("; ".join(shown), where=str(file), findings=findings)


def line_of(finding: Finding) -> int | None:
    """The line in the file itself, not in one that it includes."""
    return None if {"file", "srdf"} & finding.where.keys() else finding.where.get("line")
