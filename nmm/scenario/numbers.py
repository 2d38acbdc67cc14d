"""Numbers as people write them in a scenario: `0.005`, `1e-3`, `5/4*pi`, `sqrt(2)/2`."""

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

from nmm.base.errors import InputError, ScenarioError
from nmm.base.text_format import quoted

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
_SYNTAX = (ast.BinOp, ast.UnaryOp, ast.Name, ast.Call)
_EXPECTED = "a number or arithmetic with pi (+ - * / ** sqrt log)"


def _literal(node: ast.Constant) -> float:
    """A number as a float, so that no power can grow into an integer that fills the memory."""
    if isinstance(node.value, bool) or not isinstance(node.value, int | float):
        raise InvalidExpression(f"{node.value!r} is not a real number")
    return float(node.value)


def _arithmetic() -> SimpleEval:
    """simpleeval with floating-point numbers, + - * / **, pi, sqrt and log, and nothing else."""
    made = SimpleEval(
        operators=_OPERATORS, functions={"sqrt": math.sqrt, "log": math.log}, names={"pi": math.pi}
    )
    made.nodes = {kind: made.nodes[kind] for kind in _SYNTAX} | {ast.Constant: _literal}
    return made


@lru_cache(maxsize=10_000)
def evaluate(text: str) -> float:
    """The value of an arithmetic expression; `ValueError` when it is none, or not finite."""
    if text.strip().lower().lstrip("+-.") in ("nan", "inf", "infinity"):
        raise InputError(expected="a finite number", got=text)
    if len(text) > LONGEST:
        raise InputError(expected=f"{_EXPECTED} of at most {LONGEST} characters", got=len(text))
    try:
        value = _arithmetic().eval(text, ast.parse(text.strip(), mode="eval").body)
    except NameNotDefined as error:
        raise InputError(f"unknown name {quoted(error.name)}", expected=_EXPECTED, got=text) from None
    except ZeroDivisionError:
        raise InputError("a division by zero", expected="a finite number", got=text) from None
    except OverflowError:
        raise InputError("too large", expected="a finite number", got=text) from None
    except (InvalidExpression, SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        raise InputError(expected=_EXPECTED, got=text) from None
    if isinstance(value, complex) or callable(value):
        raise InputError(expected=_EXPECTED, got=text)
    return float(value)


def number(value: object) -> float:
    """A finite float from a number or an expression; `InputError` for anything else."""
    if isinstance(value, str):
        result = evaluate(value)
    elif isinstance(value, Real) and not isinstance(value, bool):
        result = float(value)
    else:
        raise InputError(expected=_EXPECTED, got=value)
    if not math.isfinite(result):
        raise InputError(expected="a finite number", got=value)
    return result


def integer(value: object) -> int:
    result = number(value)
    if result != int(result):
        raise InputError(expected="a whole number", got=value)
    return int(result)


def nested(value: object) -> Nested:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [nested(item) for item in value]
    return number(value)


def numbers(value: object) -> list[Nested]:
    result = nested(value)
    if not isinstance(result, list):
        raise InputError(expected="a list of numbers", got=value)
    return result


shown = ScenarioError.show

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
        except InputError as error:
            raise error.at(f"{what}{name}") from None
    return result


def number_or_by_name(value: object) -> float | dict[str, float] | None:
    if value is None:
        return None
    if isinstance(value, bool | list):
        raise InputError(expected="a number, or numbers by name", got=value)
    return numbers_by_name(value) if isinstance(value, Mapping) else number(value)


Speeds = Annotated[float | dict[str, float] | None, BeforeValidator(number_or_by_name)]


def numbers_or_by_name(value: object) -> Nested | dict[str, float]:
    return numbers_by_name(value) if isinstance(value, Mapping) else nested(value)


#: A number for all, a list, or some by name.
NumbersByName = Annotated[Nested | dict[str, float], BeforeValidator(numbers_or_by_name)]
