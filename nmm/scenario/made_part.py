"""A part of a scenario that is the call of a constructor: its keys are the parameters."""

from __future__ import annotations

from types import GenericAlias
from typing import Annotated, Any, ClassVar, Literal, Optional, TypeVar, get_args, get_origin

from pydantic import BeforeValidator, Field, create_model, model_validator
from pydantic_core import PydanticUndefined

from nmm.errors import InputError
from nmm.scenario.constructors import Parameter, parameters, summary
from nmm.scenario.keys import KeyedError, Part, at, at_key
from nmm.scenario.spelling import NOTES, SPELLINGS, Unit

#: Passed on by a part that says no unit of its own.
UNIT = "unit"


class MadePart(Part):
    """A part that makes an object of the class `makes`, which has the last word on the values."""

    makes: ClassVar[type]

    def make(self, unit: str = "m") -> Any:
        """The object; `unit` is that of values whose unit the file leaves open.

        Raises
        ------
        KeyedError, InputError : what the constructor does not take
        """
        listed: list[Any] = []
        named: dict[str, Any] = {}
        for parameter in parameters(self.makes):
            value = getattr(self, parameter.key)
            value = _argument(value, parameter.key)
            if isinstance(value, dict):
                value = {name: _argument(one, parameter.key, name) for name, one in value.items()}
            if parameter.starred:
                listed += value or ()
            else:
                named[parameter.name] = value or unit if parameter.key == UNIT else value
        with self.own_keys():
            return self.makes(*listed, **named)

    def argument(self) -> Any:
        """What another part's constructor gets where this part is its value."""
        return self.make()

    @model_validator(mode="after")
    def _can_be_made(self) -> MadePart:
        """What is wrong with the values is said when the file is read."""
        try:
            self.make()
        except KeyedError as error:
            if error.place:
                raise at_key(str(error.place[0]), error.text) from None
            raise ValueError(error.text) from None
        except InputError as error:
            raise ValueError(str(error)) from None
        return self

    def explicit(self) -> dict[str, Any]:
        """The keys, with the numbers that the library chooses where the file leaves them open."""
        made = self.make()
        open_keys = [key for key in type(self).model_fields if getattr(self, key) is None]
        chosen = {key: getattr(made, key, None) for key in open_keys}
        return self.model_dump() | {key: value for key, value in chosen.items() if type(value) is float}


def _argument(value: Any, *place: str) -> Any:
    """What a part makes; anything else as it is."""
    if not isinstance(value, MadePart):
        return value
    with at(*place):
        return value.argument()


P = TypeVar("P", bound=MadePart)


def part_of(kind: str, makes: type, base: type[P], **spelled: Any) -> type[P]:
    """The part of a class: a key for each parameter of its constructor, described by the docstring.

    Parameters
    ----------
    kind : the name that files use
    makes : the class
    base : what the part can do beside; its own keys stay
    spelled : type, and text where it is another, of the keys that files spell in a way of their own
    """
    fields: dict[str, Any] = {"kind": (Literal[kind], ...)}
    for parameter in parameters(makes):
        if parameter.key not in base.model_fields:
            fields[parameter.key] = _field(parameter, spelled.get(parameter.key), makes)
    part = create_model(f"{makes.__name__}Part", __base__=base, __module__=base.__module__, **fields)
    part.makes = makes
    part.__doc__ = summary(makes)
    return part


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
            f"{makes.__name__}: nmm.scenario.spelling says nothing of {parameter.annotation}, "
            f"the type of {parameter.name}"
        )
    default = PydanticUndefined if parameter.required else parameter.default
    least = 1 if parameter.starred else None
    if parameter.starred:
        kind = Annotated[GenericAlias(list, (kind,)), BeforeValidator(_listed)]
    if default is None:
        kind = Optional[kind]  # noqa: UP045  # of a forward reference too
    return kind, Field(default, description=text, min_length=least)


def _literal(hint: Any) -> Any:
    """The choice among texts that a type is; None for another type."""
    return next((item for item in (hint, *get_args(hint)) if get_origin(item) is Literal), None)


def _listed(value: object) -> object:
    """One for a list of one."""
    return value if value is None or isinstance(value, list | tuple) else [value]
