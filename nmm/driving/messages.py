"""The messages of a page that drives a robot, strictly checked."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from nmm.errors import InputError

#: Targets are at most this far away, m or rad.
FAR = 1e4
#: The longest message, bytes.
LONGEST = 2048

_STRICT = ConfigDict(strict=True, extra="forbid")
_Place = Annotated[float, Field(ge=-FAR, le=FAR)]


@dataclass(frozen=True, config=_STRICT)
class Aim:
    """Put the target of task number `task` at `value` (s,)."""

    task: Annotated[int, Field(ge=0, lt=1000)]
    value: Annotated[tuple[_Place, ...], Field(min_length=1, max_length=100)]
    type: Literal["aim"] = "aim"


@dataclass(frozen=True, config=_STRICT)
class Pick:
    key: str
    value: str | bool | float
    type: Literal["pick"] = "pick"


@dataclass(frozen=True, config=_STRICT)
class Order:
    what: Literal["pause", "go", "restart"]
    type: Literal["order"] = "order"


Message = Aim | Pick | Order
_MESSAGES: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="type")])


def parsed(text: str | bytes) -> Message:
    """A page's message; `InputError` for anything that our pages do not send."""
    if len(text) > LONGEST:
        raise InputError(where="message", expected=f"at most {LONGEST} bytes", got=len(text))
    try:
        return _MESSAGES.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = " ".join(map(str, first["loc"]))
        raise InputError(first["msg"], where=f"message {place}".rstrip()) from None
