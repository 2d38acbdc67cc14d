"""A part of a scenario: its keys, checked by pydantic, and the object that it makes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import reduce
from operator import or_
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from nmm.errors import InputError, unknown
from nmm.scenario.numbers import shown
from nmm.scenario.yaml_text import Place

#: Which of two a value is, where a number or a function may stand: pydantic puts it into its locations.
NUMBER, FUNCTION = "<number>", "<function>"


class KeyedError(InputError):
    """What is wrong, and at which place of the scenario; `Scenario` adds the file and the line."""

    def __init__(self, place: Place, text: str) -> None:
        super().__init__(text)
        self.place = place
        self.text = text


@contextmanager
def at(*place: str | int) -> Iterator[None]:
    """Errors of the block are about this place; places nest."""
    try:
        yield
    except KeyedError as error:
        raise KeyedError((*place, *error.place), error.text) from None
    except InputError as error:
        raise KeyedError(place, str(error)) from None


def at_key(key: str, text: str) -> PydanticCustomError:
    """What a validator raises for an error at a key of the mapping that it looks at."""
    return PydanticCustomError("at_key", "{text}", {"text": text, "key": key})


class Part(BaseModel):
    """A mapping with known keys. A subclass states them, and makes its object in a method of its own."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    #: Keys that have another name now, by the one that older files use.
    renamed: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            for key in data:
                if key in cls.renamed:
                    raise at_key(str(key), f"this key is called {cls.renamed[key]} now")
                if key not in cls.model_fields:
                    raise at_key(str(key), unknown("key", key, cls.model_fields))
        return data

    @contextmanager
    def own_keys(self) -> Iterator[None]:
        """An error of the block whose text begins with one of this part's keys is about that key."""
        try:
            yield
        except KeyedError:
            raise
        except InputError as error:
            head, _, rest = str(error).partition(": ")
            if head in type(self).model_fields and rest:
                raise KeyedError((head,), rest) from None
            raise


def one_of(parts: Mapping[str, type[Part]]) -> Any:
    """The type of a value that is one of several parts, told by its `kind`; complains about one without."""

    def check(value: Any) -> Any:
        if isinstance(value, Mapping) and "kind" not in value:
            raise at_key("kind", f"this key is missing; available: {', '.join(parts)}")
        return value

    either: Any = reduce(or_, parts.values())
    return Annotated[Annotated[either, Field(discriminator="kind")], BeforeValidator(check)]


def first_error(error: ValidationError, data: Any) -> KeyedError:
    """The first thing that pydantic found wrong with `data`, as one line at its place."""
    details = error.errors(include_url=False)
    place, text = _explained(details[0])
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    return KeyedError(as_written(place, data), text + more)


def _explained(detail: ErrorDetails) -> tuple[Place, str]:
    place = detail["loc"]
    kind, context, came = detail["type"], detail.get("ctx", {}), shown(detail["input"])
    if kind == "at_key":
        return (*place, context["key"]), context["text"]
    if kind == "value_error":
        return place, str(context["error"])
    if kind == "missing":
        return place, "this key is missing"
    if kind == "union_tag_invalid":
        names = _unquoted(context["expected_tags"]).split(", ")
        return (*place, "kind"), unknown("kind", context["tag"], names)
    if kind == "literal_error":
        names = _unquoted(context["expected"].replace(" or ", ", ")).split(", ")
        return place, unknown("value", detail["input"], names)
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
        return place, f"{message[:1].lower()}{message[1:]}, got {came}"
    return place, f"expected {expected.format(**context)}, got {came}"


def _unquoted(names: str) -> str:
    return names.replace("'", "")


def _kind_of_short(data: Mapping[str, Any]) -> str | None:
    """The kind of a mapping that is written without: {rpy: ...} and {quaternion: ...} are rotations."""
    return "rotation" if {"rpy", "quaternion"} & set(data) else None


def as_written(place: Place, data: Any) -> Place:
    """A place in the checked parts as the place in the data that they were made from.

    Left out are the kinds that pydantic puts into its locations, the index of a list of one that is
    written without the list, and the keys of what is written in short (a bare name or number).
    """
    written: list[str | int] = []
    for depth, step in enumerate(place):
        if isinstance(data, Mapping):
            if step in data:
                data = data[step]
            elif isinstance(step, int) or step in (NUMBER, FUNCTION, data.get("kind", _kind_of_short(data))):
                continue
            else:  # a key that is missing, or left at its default
                return (*written, *place[depth:])
        elif isinstance(data, list) and isinstance(step, int) and step < len(data):
            data = data[step]
        else:
            continue
        written.append(step)
    return tuple(written)
