"""Parts that are the call of a constructor: their keys are its parameters, as a file spells them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from types import GenericAlias
from typing import (
    Annotated,
    Any,
    ClassVar,
    ForwardRef,
    Literal,
    NamedTuple,
    Optional,
    Self,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    create_model,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticUndefined

from nmm.base.errors import InputError
from nmm.control.functions.function import Function
from nmm.model.robots.robot import Robot
from nmm.scenario.keys import KeyedPart, at
from nmm.scenario.numbers import Number, NumberList, Whole, nested, number, numbers, numbers_by_name

#: The key of what a constructor takes with a star: `Coordinates(*combinations)` is `of: [...]`.
STARRED = "of"


class Parameter(NamedTuple):
    name: str
    key: str  #: its name in a file
    annotation: str  #: its type as the source says it, without "| None"
    hint: Any  #: the type itself
    default: Any  #: `inspect.Parameter.empty` where there is none
    text: str  #: what the docstring says of it
    starred: bool  #: whether it takes all positional arguments

    @property
    def required(self) -> bool:
        return self.default is inspect.Parameter.empty


@cache
def parameters(made: type) -> tuple[Parameter, ...]:
    """What the constructor takes, in order."""
    texts = documented(made)
    hints = get_type_hints(made.__init__)  # type: ignore[misc]  # of this very class
    arguments = []
    for name, parameter in inspect.signature(made).parameters.items():
        starred = parameter.kind is inspect.Parameter.VAR_POSITIONAL
        default, annotation = parameter.default, parameter.annotation
        if starred:
            with suppress(TypeError, ValueError):  # none may be given
                made()
                default = None
        # As the source says it, also of a file that does not postpone the evaluation.
        written = annotation.__name__ if isinstance(annotation, type) else str(annotation)
        key, text = STARRED if starred else name, texts.get(name, "")
        arguments.append(
            Parameter(name, key, written.removesuffix(" | None"), hints[name], default, text, starred)
        )
    return tuple(arguments)


def documented(made: type) -> dict[str, str]:
    """Of each parameter what the section "Parameters" of the docstring says, on one line."""
    _, _, section = (inspect.getdoc(made) or "").partition("\nParameters\n----------\n")
    section = re.split(r"\n\n?[A-Z]\w+\n---", section)[0]
    texts: dict[str, str] = {}
    for names, text in re.findall(r"^([\w, *]+) : (.+(?:\n(?: .*)?)*)", section, re.MULTILINE):
        for name in names.split(","):
            texts[name.strip(" *")] = " ".join(text.split())
    return texts


def summary(made: type) -> str:
    return " ".join((inspect.getdoc(made) or "").partition("\n\n")[0].split())


Unit = Literal["m", "rad", "1"]


def _combination(value: object) -> str | dict[str, float]:
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping) and value:
        return numbers_by_name(value, "coefficient of ")
    raise InputError(expected="a coordinate's name, or coefficients by name ({theta: 1, q1: 1})", got=value)


def _weights(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(name): number(weight) for name, weight in value.items()}
    return numbers(value)


def _by_name(value: object) -> dict[str, float]:
    if isinstance(value, Mapping):
        return numbers_by_name(value)
    raise InputError(expected="numbers by name ({q1: 2, q2: 1})", got=value)


Combination = Annotated[str | dict[str, float], BeforeValidator(_combination)]
#: A direction by its name or as three numbers.
Direction = Annotated[str | list[float], BeforeValidator(lambda v: v if isinstance(v, str) else nested(v))]
Weights = Annotated[dict[str, float] | list[Any], BeforeValidator(_weights)]
#: A function of time or of the configuration, or what stands for one; such a function too, or the name of a
#: frame, for its origin; an orientation that does not move. They are made of parts, which are made here.
REFERENCE, POINT, ORIENTATION = (
    ForwardRef(name, module="nmm.scenario.functions") for name in ("Reference", "Point", "FixedOrientation")
)

#: By the annotation of a constructor's parameter, as it is written there, without "| None".
SPELLINGS: dict[str, Any] = {
    "bool": bool,
    "int": Whole,
    "float": Number,
    "str": str,
    "Sequence[str]": list[str],
    "str | Sequence[str]": str | list[str],
    "str | ArrayLike": Direction,
    "ArrayLike": NumberList,
    "RotationVector": ORIENTATION,
    "Combination": Combination,
    "Function": REFERENCE,
    "Function | ArrayLike": REFERENCE,
    "Function | str | ArrayLike": POINT,
    "Points": Annotated[list[POINT], BeforeValidator(lambda v: v if isinstance(v, list | tuple) else [v])],  # type: ignore[valid-type]  # a value, not a type
    "Function | RotationVector": REFERENCE,
    "Weights": Weights,
    "Mapping[str, Function | float]": dict[str, REFERENCE],  # type: ignore[valid-type]  # a value, not a type
    "Mapping[str, float]": Annotated[dict[str, float], BeforeValidator(_by_name)],
}
#: What files can say beside what the docstring says, by the same annotations.
NOTES = dict.fromkeys(
    ("Function | RotationVector", "RotationVector"), "; or {rpy: [...]}, or {quaternion: [x, y, z, w]}"
)

#: Keys whose text is a frame of the robot, and keys whose list names coordinates.
FRAMES, COORDINATES = ("frame", "relative_to"), ("of", "joints")
#: The key of a unit; a part without one takes the task's.
UNIT = "unit"


class MadePart(KeyedPart):
    """A part that makes an object of the class `makes`, which checks the values."""

    makes: ClassVar[type]
    #: Parameters that `made_with` is given: what is made of their keys depends on the robot.
    beside: ClassVar[tuple[str, ...]] = ()

    def make(self, unit: str = "m") -> Any:
        return self.made_with(unit)

    def made_with(self, unit: str = "m", **beside: Any) -> Any:
        listed: list[Any] = []
        named = beside
        for parameter in parameters(self.makes):
            if parameter.name in self.beside:
                continue
            value = _argument(getattr(self, parameter.key), parameter.key)
            if isinstance(value, dict):
                value = {name: _argument(item, parameter.key, name) for name, item in value.items()}
            elif isinstance(value, list):
                value = [_argument(item, parameter.key, str(k)) for k, item in enumerate(value)]
            if parameter.starred:
                listed += value or ()
            else:
                named[parameter.name] = value or unit if parameter.key == UNIT else value
        with self.own_keys():
            return self.makes(*listed, **named)

    def argument(self) -> Any:
        return self.make()

    @model_validator(mode="after")
    def _can_be_made(self) -> MadePart:
        """What is wrong with the values is said when the file is read."""
        self.make()
        return self

    def explicit(self) -> dict[str, Any]:
        made = self.make()
        open_keys = [key for key in type(self).model_fields if getattr(self, key) is None]
        chosen = {key: getattr(made, key, None) for key in open_keys}
        return self.model_dump() | {key: value for key, value in chosen.items() if type(value) is float}


def _argument(value: Any, *place: str) -> Any:
    if not isinstance(value, MadePart):
        return value
    with at(*place):
        return value.argument()


P = TypeVar("P", bound=MadePart)
Q = TypeVar("Q", bound=KeyedPart)


def part_of(kind: str, makes: type, base: type[P], **spelled: Any) -> type[P]:
    """The part of a class: a key for each parameter of its constructor, described by the docstring.

    The keys of `base` stay; `spelled` has the type, and the text where it is another, of keys that files
    spell in a way of their own.
    """
    part = keys_of(makes, base, kind=(Literal[kind], ...), **spelled)
    part.makes = makes
    part.__doc__ = summary(makes)
    return part


def keys_of(makes: type, base: type[Q], *without: str, **spelled: Any) -> type[Q]:
    """`base` with a key for each parameter of a class's constructor but those `without`, as of `part_of`."""
    fields = {"kind": spelled["kind"]} if "kind" in spelled else {}
    for parameter in parameters(makes):
        if parameter.key not in {*without, *base.model_fields}:
            fields[parameter.key] = _field(parameter, spelled.get(parameter.key), makes)
    return create_model(f"{makes.__name__}Part", __base__=base, __module__=base.__module__, **fields)


def _field(parameter: Parameter, spelled: Any, makes: type) -> tuple[Any, Any]:
    """Type and default, as pydantic takes them."""
    text = parameter.text + NOTES.get(parameter.annotation, "")
    if parameter.key == UNIT:
        return Unit | None, Field(None, description=f"{text}; when not given, that of the task")
    if isinstance(spelled, tuple):
        spelled, text = spelled
    kind = spelled or SPELLINGS.get(parameter.annotation) or _literal(parameter.hint)
    if kind is None:
        raise TypeError(
            f"{makes.__name__}: nmm.scenario.constructors says nothing of {parameter.annotation}, "
            f"the type of {parameter.name}"
        )
    default = PydanticUndefined if parameter.required else parameter.default
    if isinstance(default, tuple):
        default = [*default]
    least = 1 if parameter.starred else None
    if parameter.starred:
        kind = Annotated[GenericAlias(list, (kind,)), BeforeValidator(listed)]
    if default is None:
        kind = Optional[kind]  # noqa: UP045  # of a forward reference too
    return kind, Field(default, description=text, min_length=least)


def _literal(hint: Any) -> Any:
    """The choice among texts that a type is; None for another type."""
    return next((item for item in (hint, *get_args(hint)) if get_origin(item) is Literal), None)


def listed(value: object) -> object:
    return value if value is None or isinstance(value, list | tuple) else [value]


class FunctionPart(MadePart):
    """A function phi(t, q)."""

    _path: str = PrivateAttr("")

    def named(self, path: str) -> Self:
        """The same function, which the file names by this path; plain data name it so again."""
        part = self.model_copy()
        part._path = path
        return part

    @model_serializer(mode="wrap")
    def _as_named(self, plain: SerializerFunctionWrapHandler) -> Any:
        return self._path or plain(self)

    def build(self, robot: Robot, unit: str = "m") -> Function:
        check_part(self, robot)
        function: Function = self.make(unit)
        with self.own_keys():
            function.rows(robot)
            function.stages(robot)
        return function


def check_part(part: MadePart, robot: Robot) -> None:
    """`InputError`, at its key, for a frame, a coordinate or a function that the robot does not have."""
    for key in type(part).model_fields:
        value = getattr(part, key)
        with at(key):
            if key in FRAMES and value is not None:
                robot.frame_id(value)
            elif key in COORDINATES and isinstance(value, list):
                check_coordinates(value, robot)
            elif isinstance(value, FunctionPart):
                value.build(robot)
            elif isinstance(value, dict | list):
                for name, function in value.items() if isinstance(value, dict) else enumerate(value):
                    with at(str(name)):
                        if isinstance(function, FunctionPart):
                            function.build(robot)


def check_coordinates(combinations: Iterable[Any], robot: Robot) -> None:
    for combination in combinations:
        for name in [combination] if isinstance(combination, str) else combination:
            robot.coordinate(name)
