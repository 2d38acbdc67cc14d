"""A part of a scenario: its keys, checked by pydantic; and references that are named by their paths."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from nmm.base.errors import E, InputError, NmmError, ScenarioError, expect_known, no_such
from nmm.base.text_format import quoted
from nmm.scenario.yaml_text import Place

P = TypeVar("P")
T = TypeVar("T")
#: Which of two a value is, where a number or a function may stand: pydantic puts it into its locations.
NUMBER, FUNCTION = "<number>", "<function>"
_PATH = re.compile(r"task(\.\w+)+")


class KeyedError(ScenarioError):
    """What is wrong, and at which place of the scenario; `Scenario` adds the file and the line."""

    def __init__(self, place: Place, what: str = "", **fields: Any) -> None:
        super().__init__(what, **fields)
        self.place = place

    def placed(self, where: str, kind: Callable[..., E] | None = None, **others: Any) -> E:
        """The same error with another `where`, at the same place."""
        return super().placed(where, kind or partial(type(self), self.place), **others)  # type: ignore[return-value]  # of its own kind, as E is then

    @classmethod
    def of(cls, place: Place, error: NmmError) -> KeyedError:
        inner = error.place if isinstance(error, KeyedError) else ()
        return error.placed(error.where, partial(cls, (*place, *inner)))


@contextmanager
def at(*place: str | int) -> Iterator[None]:
    """Errors of the block are about this place; places nest."""
    try:
        yield
    except InputError as error:
        raise KeyedError.of(place, error) from None


def each(parts: Iterable[P], make: Callable[[P], T], *place: str | int) -> list[T]:
    """What is made of each part of the list at this place; errors know which one."""
    made = []
    for i, part in enumerate(parts):
        with at(*place, i):
            made.append(make(part))
    return made


class KeyedPart(BaseModel):
    """A mapping with known keys. A subclass states them, and makes its object in a method of its own."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            for key in data:
                if key not in cls.model_fields:
                    hint, made = cls.unknown(str(key)), partial(KeyedError, (str(key),))
                    raise no_such("key", key, cls.known_keys(), error=made, hint=hint)
        return data

    @classmethod
    def known_keys(cls) -> Collection[str]:
        """The keys that an error about another one lists."""
        return cls.model_fields

    @classmethod
    def unknown(cls, key: str) -> str:
        """What there is to say of a key that is none of this part's, behind its name."""
        return cls.without_blank(key, cls.model_fields)

    @staticmethod
    def without_blank(key: str, keys: Container[str]) -> str:
        """What there is to say of a text that is one of the keys, a colon and a value; "" of others."""
        name, colon, value = key.partition(":")
        return f": a blank after the colon, {name}: {value}" if colon and name in keys else ""

    def given(self, *keys: str) -> dict[str, Any]:
        """The values of these keys, of all when none is named, without those that are None."""
        values = {key: getattr(self, key) for key in keys or type(self).model_fields}
        return {key: value for key, value in values.items() if value is not None}

    @contextmanager
    def own_keys(self) -> Iterator[None]:
        """An error of the block is about the key of this part that its `where` begins with, or that stands
        there behind a name of what is made."""
        try:
            yield
        except KeyedError:
            raise
        except InputError as error:
            keys, (first, *rest) = type(self).model_fields, error.where.split(": ")
            head, *rest = rest if first not in keys and rest else [first, *rest]
            if head in keys:
                raise error.placed(": ".join(rest), partial(KeyedError, (head,))) from None
            raise


@dataclass(frozen=True, eq=False)
class OneOf:
    """Of an annotation: the value is one of several parts, chosen by its `kind`, which has to be there.

    pydantic builds the validator of a part when a value is of its kind: all of them take a tenth of a run.
    """

    parts: Mapping[str, type[KeyedPart]]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._read)

    def _read(self, value: Any, info: ValidationInfo) -> KeyedPart:
        if isinstance(value, KeyedPart) and type(value) in self.parts.values():
            return value
        if not isinstance(value, Mapping):
            raise InputError(expected="a mapping (key: value)", got=value)
        if "kind" not in value:
            for key in value:
                if hint := KeyedPart.without_blank(str(key), ("kind",)):
                    raise KeyedError((str(key),), f"unknown key {quoted(key)}{hint}")
            raise KeyedError(("kind",), "this key is missing", available=self.parts)
        kind = value["kind"]
        if not isinstance(kind, str) or kind not in self.parts:
            raise no_such("kind", kind, self.parts, error=partial(KeyedError, ("kind",)))
        return self.parts[kind].model_validate(value, context=info.context)


def first_error(error: ValidationError, data: Any) -> KeyedError:
    """The first thing that pydantic found wrong with `data`, as one line at its place."""
    details = error.errors(include_url=False)
    first = _explained(details[0])
    what = first.what
    if len(details) > 1:
        what = f"the first of {len(details)} faults" + (f": {what}" if what else "")
    return first.placed(first.where, partial(KeyedError, as_written(first.place, data)), what=what)


def _explained(detail: ErrorDetails) -> KeyedError:
    place, kind, context, came = detail["loc"], detail["type"], detail.get("ctx", {}), detail["input"]
    if kind == "value_error":
        error = context["error"]
        return KeyedError.of(place, error if isinstance(error, NmmError) else InputError(str(error)))
    if kind == "missing":
        return KeyedError(place, "this key is missing")
    if kind == "literal_error":
        names = context["expected"].replace(" or ", ", ").replace("'", "").split(", ")
        return no_such("value", came, names, error=partial(KeyedError, place))
    expected = {
        "greater_than": "a number above {gt:g}",
        "too_short": "at least {min_length}",
        "list_type": "a list",
        "string_pattern_mismatch": "letters, digits and _ . - only",
        "dict_type": "a mapping (key: value)",
        "model_type": "a mapping (key: value)",
        "model_attributes_type": "a mapping (key: value)",
        "string_type": "a name or text",
        "bool_type": "true or false",
        "bool_parsing": "true or false",
    }.get(kind)
    if expected is None:
        message = " ".join(detail["msg"].split())
        return KeyedError(place, f"{message[:1].lower()}{message[1:]}, got {ScenarioError.show(came)}")
    return KeyedError(place, expected=expected.format(**context), got=came)


def as_written(place: Place, data: Any) -> Place:
    """A place in the checked parts as the place in the data that they were made from.

    Omits the kinds that pydantic adds, the index of a list of one written without the list, and the keys of
    shorthand (a bare name or number).
    """
    written: list[str | int] = []
    for depth, step in enumerate(place):
        if isinstance(data, Mapping):
            short = "rotation" if {"rpy", "quaternion"} & {*data} else None  # written without its kind
            if step in data:
                data = data[step]
            elif isinstance(step, int) or step in (NUMBER, FUNCTION, data.get("kind", short)):
                continue
            else:  # a key that is missing, or left at its default
                return (*written, *place[depth:])
        elif isinstance(data, list) and isinstance(step, int) and step < len(data):
            data = data[step]
        else:
            continue
        written.append(step)
    return tuple(written)


def is_path(value: object) -> bool:
    """Whether a text is meant as a path to a task's reference: no number is, and no frame is called so."""
    return isinstance(value, str) and _PATH.fullmatch(value.strip()) is not None


class NamedReferences:
    """The references of a scenario's tasks by their paths, from its plain data; the validators' context."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        tasks = data.get("task")
        listed = {"task": tasks} if isinstance(tasks, Mapping) else {}
        # A task that is written without the list is the list's only one, too.
        numbered = tasks if isinstance(tasks, list) else listed.values()
        listed |= {f"task.{i}": task for i, task in enumerate(numbered)}
        self._references = {
            f"{name}.reference": task["reference"]
            for name, task in listed.items()
            if isinstance(task, Mapping) and "reference" in task
        }
        self._open: list[str] = []

    @contextmanager
    def followed(self, path: str) -> Iterator[Any]:
        """What is written at a path; `ValueError` where nothing is, and in a circle."""
        expect_known("reference", path, self._references)
        if path in self._open:
            circle = " → ".join([*self._open[self._open.index(path) :], path])
            raise InputError(expected="a reference that does not lead back to itself", got=circle)
        self._open.append(path)
        try:
            yield copy.deepcopy(self._references[path])  # pydantic takes the same object for a circle
        finally:
            self._open.pop()


def references_of(info: ValidationInfo) -> NamedReferences:
    """Those of the scenario that is being checked; a part that is checked alone has none."""
    return info.context if isinstance(info.context, NamedReferences) else NamedReferences({})
