"""The errors that nmm raises: one root, and below it what the user can tell apart.

They carry what is wrong, where, what was expected, what came, and what is available, as fields.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from types import UnionType
from typing import Any, TypeVar, cast

from nmm.base.text_format import one_line, printable, quoted


class _Nothing:
    def __reduce__(self) -> str:
        return "NOTHING"  # there is one of it in every process


#: Stands for a `got` that there is none of: None is something that a user may give.
NOTHING = _Nothing()
#: No message is longer.
MOST = 300
#: A longer name is no misspelling; a longer `where` is cut in its middle where the text would be too long.
LONGEST = 140
#: As many of the names available are shown, if they have no more characters than this.
SHOWN, ROOM = 10, 200
#: As many values of an array.
FIRST = 6

T = TypeVar("T")
E = TypeVar("E", bound="NmmError")


@dataclass(frozen=True)
class Setting:
    """A key of a scenario, step by step, and a value for it, as YAML; its text is for a shell.

    Examples
    --------
    >>> print(nmm.Setting(("resolver", "alpha"), "5"))
    --set 'resolver.alpha=5'
    """

    path: tuple[str, ...]
    value: str

    def __str__(self) -> str:
        return f"--set '{'.'.join(self.path)}={self.value}'"


class NmmError(Exception):
    """Root of every error that nmm raises on purpose; its text is made of its fields.

    The text is "where: what; expected …, as in …, got …; available: …", on one line of at most 300
    characters.

    Parameters
    ----------
    what : what is wrong, in a few words: "unknown frame 'eee'"; empty where `expected` says it. A Finding
        is kept as `finding`; its sentence is the words
    where : the argument, key, file or part of one that it is about, from outside in: "task ee: gain"
    expected : what would have been right, in words: "a number above 0"
    got : what came instead, as it came; `nmm.base.errors.NOTHING` where nothing did
    available : the names that there are; the text shows ten near ones and how many more there are
    mend : what would mend it, behind what was expected: a `Setting`, or how a command takes it
    unknown : what `got` is the name of, where there is none of that name: "key", "frame"

    Examples
    --------
    >>> try:
    ...     nmm.load("no_such_robot")
    ... except nmm.NmmError as error:
    ...     print(type(error).__name__)
    RobotError
    """

    def __init__(
        self,
        what: object = "",
        *,
        where: object = "",
        expected: str = "",
        got: object = NOTHING,
        available: Iterable[object] | None = None,
        mend: Setting | str | None = None,
        unknown: str = "",
    ) -> None:
        self.finding = None if isinstance(what, str) else what
        self.what, self.where, self.expected, self.got = str(what), str(where), expected, got
        self.available = None if available is None else tuple(str(name) for name in available)
        self.mend, self.unknown = mend, unknown
        super().__init__(self._text())

    def at(self, where: object, kind: Callable[..., E] | None = None) -> E:
        """The same error of the kind given (its own), further out: `where` comes before its own."""
        return self.placed(": ".join(part for part in (str(where), self.where) if part), kind)

    def placed(self, where: str, kind: Callable[..., E] | None = None, **others: Any) -> E:
        """The same error of the kind given (its own), with another `where`, and other fields where given."""
        fields = {name: getattr(self, name) for name in ("expected", "got", "available", "mend", "unknown")}
        fields["what"] = self.what if self.finding is None else self.finding
        made: Callable[..., Any] = kind or type(self)
        return cast("E", made(where=where, **fields | others))

    def _text(self) -> str:
        text = self.what
        if self.expected:
            came = "" if self.got is NOTHING else f", got {self.show(self.got)}"
            mend = "" if self.mend is None else f", as in {self.mend}"
            text += f"{'; ' if text else ''}expected {self.expected}{mend}{came}"
        where = _without_middle(self.where, max(LONGEST, MOST - len(text) - LONGEST // 2))
        head = ": ".join(part for part in (where, text) if part)
        head = one_line(printable(one_line(head, MOST)), MOST)
        if self.available is None:
            return head
        names, near = self.available, self.got if isinstance(self.got, str) else ""
        tails = (f"; available: {few(names, near, shown)}" for shown in range(min(len(names), SHOWN), -1, -1))
        for tail in tails:
            if len(head) + len(tail) <= MOST:
                return head + tail
        return one_line(head, MOST - len(tail)) + tail

    @staticmethod
    def show(value: object) -> str:
        """A value as the text shows it."""
        return shown(value)

    def __reduce__(self) -> tuple[Any, ...]:
        import pickle

        state = self.__dict__
        try:
            pickle.loads(pickle.dumps(self.got))
        except Exception:  # a stranger's object: another process gets its text
            state = state | {"got": self.show(self.got)}
        return _restored, (type(self), self.args, state)


def _restored(kind: type[E], arguments: tuple[str, ...], state: dict[str, Any]) -> E:
    error = kind.__new__(kind, *arguments)
    error.__dict__.update(state)
    return error


class InputError(NmmError, ValueError):
    """Something that the user gave is wrong: a name, a shape, a number, a file.

    It carries what a script may want to know: `what`, `where`, `expected`, `got` and `available`, as
    `NmmError` documents them.

    Examples
    --------
    >>> nmm.load("unicycle_2r").q({"q9": 1.0})
    Traceback (most recent call last):
        ...
    nmm.base.errors.InputError: robot unicycle_2r: unknown coordinate 'q9'; available: x, y, theta, q1, q2
    """


class RobotError(InputError):
    """A robot description (URDF, xacro, `pin.Model`) cannot be used, and why.

    Examples
    --------
    >>> nmm.load("unicycle_2r", lock={"q9": 0.0})
    Traceback (most recent call last):
        ...
    nmm.base.errors.RobotError: unicycle_2r: unknown joint to lock 'q9'; available: q1, q2, ...

    Attributes
    ----------
    findings : what was found in the robot's file (each a `Finding`), where that is what is wrong
    """

    def __init__(self, what: str = "", *, findings: Iterable[Any] = (), **fields: Any) -> None:
        self.findings = tuple(findings)
        super().__init__(what, **fields)

    def _text(self) -> str:  # of up to twelve things, of which each has its own length
        return printable(f"{self.where}: {self.what}") if self.findings else super()._text()

    def placed(self, where: str, kind: Callable[..., E] | None = None, **others: Any) -> E:
        """The same error with another `where`, and what was found."""
        if kind is not None or not self.findings:
            return super().placed(where, kind, **others)
        return type(self)(self.what, where=where, findings=self.findings)  # type: ignore[return-value]  # of its own kind, as E is then


class ScenarioError(InputError):
    """A scenario file or a `--set` is wrong: the message names file, key and what was expected.

    Examples
    --------
    >>> nmm.Scenario.load("unicycle_2r_position", {"resolver.alfa": 5})
    Traceback (most recent call last):
        ...
    nmm.base.errors.ScenarioError: ...unicycle_2r_position.yaml: set resolver.alfa: unknown key 'alfa'...
    """

    @staticmethod
    def show(value: object) -> str:
        """A value as YAML writes it."""
        if value is None:
            return "nothing (null)"
        return str(value).lower() if isinstance(value, bool) else shown(value)


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
    nmm.base.errors.SingularError: at t = 0 s: the task Jacobian J lost rank, ...
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


def shown(value: object, deep: int = 3) -> str:
    """A value as an error shows it: floats short, arrays by shape and first values, on one line; lists in
    lists so deep, since a list may hold itself."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple) and 0 < len(value) < FIRST and deep:
        inner = ", ".join(shown(item, deep - 1) for item in value)
        return f"[{inner}]" if isinstance(value, list) else f"({inner})"
    if hasattr(value, "__array_interface__"):  # NumPy's: importing it here every start would pay
        return _shown_array(value)
    try:
        return quoted(value)
    except Exception:  # a stranger's __repr__
        return type(value).__name__


def _shown_array(value: Any) -> str:
    if value.ndim == 0:
        return shown(value.item())
    values = ", ".join(shown(item) for item in value.ravel()[:FIRST].tolist())
    if value.ndim == 1 and value.size <= FIRST:
        return f"[{values}]"
    return f"shape {value.shape}{': ' if values else ''}{values}{', …' if value.size > FIRST else ''}"


def _without_middle(where: str, most: int) -> str:
    half = most // 2
    return where if len(where) <= most else f"{where[: half - 1]}…{where[-half:]}"


def few(names: Sequence[str], near: str = "", shown: int = SHOWN) -> str:
    """At most ten of the names, fewer of long ones, those most like `near` first, and a count of the others;
    "none" for none."""
    if not names:
        return "none"
    if shown == 0:
        return f"{len(names)} names"
    if len(names) > shown and near:
        import difflib  # here: every start would pay

        matcher = difflib.SequenceMatcher(b=near[:LONGEST].lower())

        def unlike(name: str) -> float:
            matcher.set_seq1(name[:LONGEST].lower())
            return -matcher.ratio()

        names = sorted(names, key=unlike)
    texts = [one_line(printable(str(name)[:LONGEST]), LONGEST // 2) for name in names[:shown]]
    while len(texts) > 1 and len(", ".join(texts)) > ROOM:
        texts.pop()
    listing = ", ".join(texts)
    return listing if len(texts) == len(names) else f"{listing} and {len(names) - len(texts)} more"


def no_such(
    kind: str,
    name: object,
    available: Iterable[object],
    where: object = "",
    error: Callable[..., E] = InputError,  # type: ignore[assignment]  # a class is called, too
    hint: str = "",
) -> E:
    """The error for a name that does not exist: `got` is the name, `what` holds the hint, or the nearest
    match, in upper or lower case.

    >>> no_such("frame", "eee", ["ee", "link1"])
    InputError("unknown frame 'eee' (did you mean 'ee'?); available: ee, link1")
    """
    import difflib  # here: every start would pay

    asked, names = str(name), [str(candidate) for candidate in available]
    short = [candidate for candidate in names if len(candidate) < LONGEST]
    near = [candidate for candidate in short if candidate.lower() == asked.lower()]
    if not near and len(asked) < LONGEST:
        near = difflib.get_close_matches(asked, short, n=1)
    hint = hint or (f" (did you mean {quoted(near[0])}?)" if near else "")
    what = f"unknown {kind} {quoted(name)}{hint}"
    return error(what, where=where, got=name, available=names, unknown=kind)


def expect_known(
    kind: str,
    name: object,
    available: Collection[Any],
    where: object = "",
    error: type[NmmError] = InputError,
) -> None:
    """Raise `no_such` of the type given for a name that is not among those available."""
    if name not in available:
        raise no_such(kind, name, available, where, error)


def expect(holds: object, where: object, expected: str, got: object = NOTHING) -> None:
    """Raise `InputError` unless it holds; where each call counts, an `if` makes no text in vain."""
    if not holds:
        raise InputError(where=where, expected=expected, got=got)


def expect_kind(
    value: object, kind: type | tuple[type, ...] | UnionType, where: object, expected: str
) -> None:
    if not isinstance(value, kind):
        raise InputError(where=where, expected=expected, got=value)


def one_or_several(value: Any, kind: type[T] | UnionType, where: object, expected: str) -> tuple[T, ...]:
    """One value or a sequence of them as a tuple; `InputError` for anything of another kind."""
    values = (value,) if isinstance(value, kind) else value
    if not isinstance(values, Sequence) or not all(isinstance(item, kind) for item in values):
        raise InputError(where=where, expected=expected, got=value)
    return tuple(values)
