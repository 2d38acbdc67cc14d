"""The errors that nmm raises: one root, and below it what the user can tell apart.

Every message says what was expected, what came, and what is available.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

from nmm.words import one_line, quoted


class NmmError(Exception):
    """Root of every error that nmm raises on purpose.

    Examples
    --------
    >>> try:
    ...     nmm.load("no_such_robot")
    ... except nmm.NmmError as error:
    ...     print(type(error).__name__)
    RobotError
    """


class InputError(NmmError, ValueError):
    """Something that the user gave is wrong: a name, a shape, a number, a file.

    Examples
    --------
    >>> nmm.load("unicycle_2r").q({"q9": 1.0})
    Traceback (most recent call last):
        ...
    nmm.errors.InputError: robot unicycle_2r: unknown coordinate 'q9'; available: x, y, theta, q1, q2
    """


class RobotError(InputError):
    """A robot description (URDF, xacro, `pin.Model`) cannot be used, and why.

    Examples
    --------
    >>> nmm.load("unicycle_2r", lock={"q9": 0.0})
    Traceback (most recent call last):
        ...
    nmm.errors.RobotError: unicycle_2r: unknown joint to lock 'q9'; available: q1, q2, ...
    """


class ScenarioError(InputError):
    """A scenario file or a `--set` is wrong: the message names file, key and what was expected.

    Examples
    --------
    >>> nmm.Scenario.load("unicycle_2r_position", {"resolver.alfa": 5})
    Traceback (most recent call last):
        ...
    nmm.errors.ScenarioError: ...unicycle_2r_position.yaml: set resolver.alfa: unknown key 'alfa'...
    """


class RunError(NmmError, RuntimeError):
    """A computation that began with good input could not go on.

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.5])
    >>> controller = nmm.Controller(arm, task, nmm.ProjectedGradient())
    >>> try:
    ...     controller(0.0, arm.rest)
    ... except nmm.RunError as error:
    ...     print(type(error).__name__)
    SingularError
    """


class SingularError(RunError):
    """The matrix that a resolver has to invert lost rank.

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.5])
    >>> nmm.Controller(arm, task, nmm.ProjectedGradient())(0.0, arm.rest)
    Traceback (most recent call last):
        ...
    nmm.errors.SingularError: at t = 0 s: the task Jacobian J lost rank, ...
    """


class DivergedError(RunError):
    """The motion grew without bound; `alpha * dt` is usually too large.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0], gain=1.0)
    >>> law = nmm.CallableResolver(lambda problem: 1e6 * problem.rate.sum() * np.ones(4))
    >>> controller = nmm.Controller(robot, task, law)
    >>> str(nmm.simulate(controller, robot.q({"q2": 0.5}), 1.0).outcome)
    'diverged'
    """


#: A longer name is no misspelling.
LONGEST = 200


def unknown(kind: str, name: object, available: Iterable[str], where: str = "") -> str:
    """One line for a name that does not exist: what came, the nearest match, what there is.

    >>> unknown("frame", "eee", ["ee", "link1"])
    "unknown frame 'eee' (did you mean 'ee'?); available: ee, link1"
    """
    import difflib  # here: every start would pay

    names, asked = list(available), str(name)
    near = difflib.get_close_matches(asked, names, n=1) if len(asked) < LONGEST else []
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    listing = ", ".join(one_line(name, LONGEST) for name in names) if names else "none"
    prefix = f"{where}: " if where else ""
    return f"{prefix}unknown {kind} {quoted(name)}{hint}; available: {listing}"


def expect_known(
    kind: str, name: object, available: Collection[Any], where: str = "", error: type[InputError] = InputError
) -> None:
    """The error, in the words of `unknown`, for a name that is not among those available."""
    if name not in available:
        raise error(unknown(kind, name, available, where))
