"""How much work a robot's file may ask for: xacro is a language, a few lines of which can ask for more than
any machine has. No known robot comes near a bound."""

from __future__ import annotations

import ast
import io
import math
import re
import time
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from nmm.base.files import read_bytes
from nmm.base.findings import Finding

#: Steps of xacro (an element, a piece of text, a call in an expression, an item of its loops), what a file
#: counts, and how many seconds of processor they may take.
MOST_STEPS, STEPS_OF_A_FILE, PATIENCE = 500_000, 100, 10.0
#: Characters in all that is read and made, in one expression, in a YAML file; bits of an integer.
LONGEST, LONGEST_EXPRESSION, LONGEST_YAML, MOST_BITS = 50_000_000, 20_000, 1_000_000, 10_000
#: Elements in a file or in what becomes of it, its links, those in a row, and joints that move.
MOST_ELEMENTS, MOST_LINKS, MOST_IN_A_ROW, MOST_MOVING = 200_000, 10_000, 1_000, 500
#: Functions whose integers have as many digits as the argument is large.
_GROWING = (math.factorial, math.comb, math.perm)
_QUOTED = re.compile("'[^']*'|\"[^\"]*\"")


class BeyondBound(Exception):
    """A bound, by what it counts."""

    def __init__(self, what: str, most: float) -> None:
        self.finding = Finding("beyond_bound", {"what": what, "most": most})
        super().__init__(str(self.finding))


class Budget:
    """What the expansion of one file has used."""

    def __init__(self) -> None:
        self._steps, self._length, self._until = 0, 0, time.thread_time() + PATIENCE

    def step(self, count: int = 1) -> None:
        before, self._steps = self._steps, self._steps + count
        if self._steps > MOST_STEPS:
            raise BeyondBound("steps of xacro", MOST_STEPS)
        # Not each time: the clock may take longer than the step.
        if before // 16 < self._steps // 16 and time.thread_time() > self._until:
            raise BeyondBound("seconds of processor for xacro", PATIENCE)

    def took(self, value: Any) -> Any:
        """The value, counted by its length."""
        self.step()
        if isinstance(value, int) and value.bit_length() > MOST_BITS:
            raise BeyondBound("bits in an integer", MOST_BITS)
        if isinstance(value, str | list | tuple | dict | set | range):
            self._length += len(value)
            if self._length > LONGEST:
                raise BeyondBound("characters and items for xacro", LONGEST)
        return value

    def each(self, items: Iterable[Any]) -> Iterator[Any]:
        for item in items:
            self.step()
            yield item

    def called(self, function: Any, *arguments: Any, **named: Any) -> Any:
        if function in _GROWING and max(map(abs, arguments), default=0) > 1_000:
            raise BeyondBound("bits in an integer", MOST_BITS)
        return self.took(function(*arguments, **named))

    def power(self, base: Any, exponent: Any) -> Any:
        if isinstance(base, int) and isinstance(exponent, int) and base.bit_length() * exponent > MOST_BITS:
            raise BeyondBound("bits in an integer", MOST_BITS)
        return base**exponent

    def times(self, left: Any, right: Any) -> Any:
        for value, count in ((left, right), (right, left)):
            if isinstance(value, str | list | tuple) and isinstance(count, int):
                self.took(range(max(0, len(value) * min(count, LONGEST + 1))))
        return self.took(left * right)

    def shift(self, value: Any, count: Any) -> Any:
        if isinstance(count, int) and count > MOST_BITS:
            raise BeyondBound("bits in an integer", MOST_BITS)
        return self.took(value << count)


#: The names under which expressions have a budget's methods; xacro refuses two underscores.
_NAMES = {name: f"nmm_{name}" for name in ("each", "called", "power", "times", "shift")}
_OPERATORS: dict[type[ast.operator], str] = {ast.Pow: "power", ast.Mult: "times", ast.LShift: "shift"}


class _Counted(ast.NodeTransformer):
    """An expression that asks a budget before it grows."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        name = _OPERATORS.get(type(node.op))
        return node if name is None else _call(name, node.left, node.right)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        return ast.Call(ast.Name(_NAMES["called"], ast.Load()), [node.func, *node.args], node.keywords)

    def visit_comprehension(self, node: ast.comprehension) -> ast.comprehension:
        self.generic_visit(node)
        node.iter = _call("each", node.iter)
        return node


def _call(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(_NAMES[name], ast.Load()), [*arguments], [])


@lru_cache(maxsize=10_000)
def _compiled(text: str, filename: str, mode: str) -> Any:
    if len(text) > LONGEST_EXPRESSION:
        raise BeyondBound("characters in an expression", LONGEST_EXPRESSION)
    tree = _Counted().visit(ast.parse(text, filename, mode))
    return compile(ast.fix_missing_locations(tree), filename, mode)


def counted_xacro(xacro: Any, budget: Budget) -> list[tuple[Any, str, Any]]:
    """The replacements, with a budget, of xacro's functions, and of Python's own, which xacro's modules look
    up after their own names: owner, name and value."""
    methods = {name: getattr(budget, method) for method, name in _NAMES.items()}

    evaluate_all, evaluate, evaluate_text = xacro.eval_all, xacro.safe_eval, xacro.eval_text
    parse_parameters = xacro.parse_macro_arg

    def elements(node: Any, macros: Any, symbols: Any) -> None:
        budget.step()
        evaluate_all(node, macros, symbols)

    def text(content: Any, symbols: Any) -> Any:
        if len(content) * content.count("$") > LONGEST:  # xacro copies what is left at each
            raise BeyondBound("characters and expressions in a text", LONGEST)
        return budget.took(evaluate_text(content, symbols))

    def parameters(params: str) -> Any:
        budget.step()
        if re.search("['\"]", _QUOTED.sub("", params)):  # xacro's pattern would try for ever
            raise xacro.XacroException("a quote without end in a macro's params")
        return parse_parameters(params)

    def cloned(node: Any, deep: bool, document: Any) -> Any:
        budget.step()
        return clone(node, deep, document)

    minidom = xacro.xml.dom.minidom
    clone = minidom._clone_node
    return [
        (minidom, "_clone_node", cloned),
        (xacro, "eval_all", elements),
        (xacro, "eval_text", text),
        (xacro, "safe_eval", lambda expression, *names: budget.took(evaluate(expression, *names))),
        (xacro, "parse_macro_arg", parameters),
        (xacro, "_global_symbols", {**xacro._global_symbols, **methods}),
        (xacro, "compile", _compiled),
        (xacro, "open", _yaml_file),
        (xacro.substitution_args, "eval", partial(_evaluated, methods)),
    ]


def _evaluated(methods: Mapping[str, Any], text: str, _: Any, names: Any) -> Any:
    return eval(_compiled(text.strip(), "<eval>", "eval"), {**methods}, names)


def _yaml_file(name: str) -> io.StringIO:
    return io.StringIO(read_bytes(Path(name), LONGEST_YAML).decode("utf-8-sig"))
