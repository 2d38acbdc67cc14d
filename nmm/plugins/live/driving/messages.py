"""What a page says to the loop that drives a robot."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from nmm.base.errors import InputError

#: Targets are at most this far away, m or rad.
FAR = 1e4
#: The longest message, bytes.
LONGEST = 2048

_STRICT = ConfigDict(strict=True, extra="forbid")
_Place = Annotated[float, Field(ge=-FAR, le=FAR)]
_Share = Annotated[float, Field(ge=-1.0, le=1.0)]


@dataclass(frozen=True, config=_STRICT)
class Aim:
    """Put the target of task number `task` at `value` (s,); pictures that know of it carry its `number`."""

    task: Annotated[int, Field(ge=0, lt=1000)]
    value: Annotated[tuple[_Place, ...], Field(min_length=1, max_length=100)]
    number: Annotated[int, Field(ge=0, lt=2**53)] = 0
    type: Literal["aim"] = "aim"


@dataclass(frozen=True, config=_STRICT)
class Pick:
    key: str
    value: str | bool | float
    type: Literal["pick"] = "pick"


@dataclass(frozen=True, config=_STRICT)
class Order:
    what: Literal["pause", "go", "restart", "here", "plan", "react"]
    type: Literal["order"] = "order"


@dataclass(frozen=True, config=_STRICT)
class Jog:
    """Move the base, or the frame of task number `task`, for a moment: shares of full speed along x, y, z and
    about them, in the axes of `frame` (a base has its own); all 0 to stop at once."""

    part: Literal["hand", "base"]
    axes: tuple[_Share, _Share, _Share, _Share, _Share, _Share]
    frame: Literal["hand", "base", "world"] = "hand"
    task: Annotated[int, Field(ge=0, lt=1000)] = 0
    type: Literal["jog"] = "jog"

    @property
    def moves(self) -> bool:
        return any(self.axes)


Message = Aim | Pick | Order | Jog
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
