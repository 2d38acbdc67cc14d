"""What a page may say to the program: few kinds of messages, checked to the last number."""

from __future__ import annotations

import json
from dataclasses import dataclass

from nmm.errors import InputError, expect_known

#: A target farther away than this, m or rad, is nobody's wish.
FAR = 1e4
#: The longest message, bytes.
LONGEST = 2048
ORDERS = ("pause", "go", "restart")


@dataclass(frozen=True)
class Aim:
    """Put the target of task number `task` at `value` (s numbers)."""

    task: int
    value: tuple[float, ...]


@dataclass(frozen=True)
class Pick:
    """Choose `value` for `key`."""

    key: str
    value: str | bool | float


@dataclass(frozen=True)
class Order:
    """Pause, go on, or begin again."""

    what: str


Message = Aim | Pick | Order


def parsed(text: str | bytes) -> Message:
    """What a message says.

    Raises
    ------
    InputError : anything that no page of ours sends
    """
    if len(text) > LONGEST:
        raise InputError(f"message: expected at most {LONGEST} bytes, got {len(text)}")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        raise InputError("message: expected JSON") from None
    if not isinstance(data, dict):
        raise InputError("message: expected a mapping")
    kind = data.get("type")
    if kind == "aim" and data.keys() == {"type", "task", "value"}:
        return _aim(data["task"], data["value"])
    if kind == "pick" and data.keys() == {"type", "key", "value"}:
        return _pick(data["key"], data["value"])
    if kind == "order" and data.keys() == {"type", "what"}:
        expect_known("what", str(data["what"])[:20], ORDERS, "message")
        return Order(str(data["what"]))
    raise InputError("message: expected type aim, pick or order, with its keys")


def _aim(task: object, value: object) -> Aim:
    if isinstance(task, bool) or not isinstance(task, int) or not 0 <= task < 1000:
        raise InputError("message: task: expected a task's number")
    if not isinstance(value, list) or not 0 < len(value) <= 100 or not all(_is_place(x) for x in value):
        raise InputError(f"message: value: expected numbers from {-FAR:g} to {FAR:g}")
    return Aim(task, tuple(float(x) for x in value))


def _is_place(x: object) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= FAR


def _pick(key: object, value: object) -> Pick:
    if not isinstance(key, str) or not isinstance(value, str | bool | int | float):
        raise InputError("message: expected a key and a word, a number, or true or false")
    return Pick(key, value)
