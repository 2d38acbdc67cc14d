"""Numbers as people write them in a scenario: `0.005`, `1e-3`, `5/4*pi`, `sqrt(2)/2`."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache
from numbers import Real
from typing import Annotated, Any

from pydantic import BeforeValidator, Field
from simpleeval import (  # type: ignore[import-untyped]  # it has no annotations
    InvalidExpression,
    NameNotDefined,
    SimpleEval,
)

from nmm.words import quoted

#: Numbers, or lists of them to any depth, as plain data.
Nested = float | list[Any]

LONGEST = 200
_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_SYNTAX = (ast.BinOp, ast.UnaryOp, ast.Constant, ast.Name, ast.Call)
_EXPECTED = "expected a number or arithmetic with pi (+ - * / ** sqrt)"


class _Arithmetic(SimpleEval):
    """simpleeval with floating-point numbers, + - * / **, pi and sqrt, and nothing else.

    Every literal becomes a float, so that no power can grow into an integer that fills the memory.
    """

    nodes: dict[type[ast.AST], Callable[..., Any]]

    def __init__(self) -> None:
        super().__init__(operators=_OPERATORS, functions={"sqrt": math.sqrt}, names={"pi": math.pi})
        self.nodes = {kind: evaluate for kind, evaluate in self.nodes.items() if kind in _SYNTAX}
        self.nodes[ast.Constant] = self._literal

    @staticmethod
    def _literal(node: ast.Constant) -> float:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise InvalidExpression(f"{node.value!r} is not a real number")
        return float(node.value)


@lru_cache(maxsize=10_000)
def evaluate(text: str) -> float:
    """The value of an arithmetic expression; `ValueError` when it is none, or not finite."""
    if text.strip().lower().lstrip("+-.") in ("nan", "inf", "infinity"):
        raise ValueError(f"expected a finite number, got {text!r}")
    if len(text) > LONGEST:
        raise ValueError(f"{_EXPECTED} of at most {LONGEST} characters, got {len(text)}")
    try:
        value = _Arithmetic().eval(text, ast.parse(text.strip(), mode="eval").body)
    except NameNotDefined as error:
        raise ValueError(f"{_EXPECTED}, got {text!r} (unknown name {error.name!r})") from None
    except ZeroDivisionError:
        raise ValueError(f"expected a finite number, got {text!r} (a division by zero)") from None
    except OverflowError:
        raise ValueError(f"expected a finite number, got {text!r} (too large)") from None
    except (InvalidExpression, SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        raise ValueError(f"{_EXPECTED}, got {text!r}") from None
    if isinstance(value, complex) or callable(value):
        raise ValueError(f"{_EXPECTED}, got {text!r}")
    return float(value)


def number(value: object) -> float:
    """A finite float from a number or an expression; `ValueError` says what came instead."""
    if isinstance(value, str):
        result = evaluate(value)
    elif isinstance(value, Real) and not isinstance(value, bool):
        result = float(value)
    else:
        raise ValueError(f"{_EXPECTED}, got {shown(value)}")
    if not math.isfinite(result):
        raise ValueError(f"expected a finite number, got {shown(value)}")
    return result


def integer(value: object) -> int:
    """A whole number."""
    result = number(value)
    if result != int(result):
        raise ValueError(f"expected a whole number, got {shown(value)}")
    return int(result)


def nested(value: object) -> Nested:
    """A number, or lists of them to any depth: shapes are the business of what reads them."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [nested(item) for item in value]
    return number(value)


def numbers(value: object) -> list[Nested]:
    """A list of numbers, or of lists of them."""
    result = nested(value)
    if not isinstance(result, list):
        raise ValueError(f"expected a list of numbers, got {shown(value)}")
    return result


def shown(value: object) -> str:
    """A value as an error shows it: on one line, not too long."""
    if value is None:
        return "nothing (null)"
    if isinstance(value, bool):
        return str(value).lower()
    return quoted(value)


Number = Annotated[float, BeforeValidator(number)]
Positive = Annotated[float, BeforeValidator(number), Field(gt=0.0)]
Whole = Annotated[int, BeforeValidator(integer)]
#: A number or lists of them: a gain, the points of a spline.
Numbers = Annotated[Nested, BeforeValidator(nested)]
#: A list of numbers (a vector) or of lists of them (a matrix).
NumberList = Annotated[list[Nested], BeforeValidator(numbers)]


def numbers_by_name(value: Mapping[Any, object], what: str = "") -> dict[str, float]:
    """Numbers by name; `ValueError` names the one that is none, after `what` ("coefficient of ")."""
    result = {}
    for name, item in value.items():
        try:
            result[str(name)] = number(item)
        except ValueError as error:
            raise ValueError(f"{what}{name}: {error}") from None
    return result


def number_or_by_name(value: object) -> float | dict[str, float] | None:
    """A number for all, or numbers by name."""
    if value is None:
        return None
    if isinstance(value, bool | list):
        raise ValueError(f"expected a number, or numbers by name, got {shown(value)}")
    return numbers_by_name(value) if isinstance(value, Mapping) else number(value)


Speeds = Annotated[float | dict[str, float] | None, BeforeValidator(number_or_by_name)]
