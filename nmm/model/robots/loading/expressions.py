"""The expressions of xacro files, ${...} and $(eval ...), as they may be evaluated.

What is not trusted is held to the nodes of `_NODES`, to those of xacro's functions that make data of data,
and to dots that look a name up in a table. So no object has a way to Python's own machinery.
"""

from __future__ import annotations

import ast
import builtins
import re
from functools import lru_cache
from typing import Any

from nmm.base.trust import is_trusted
from nmm.model.robots.loading.budget import LONGEST_EXPRESSION, BeyondBound, Budget
from nmm.model.robots.loading.trust import untrusted

_NODES: tuple[type[ast.AST], ...] = (
    *(ast.Expression, ast.Constant, ast.Name, ast.expr_context, ast.List, ast.Tuple, ast.Dict, ast.Set),
    *(ast.BinOp, ast.operator, ast.UnaryOp, ast.unaryop, ast.BoolOp, ast.boolop, ast.Compare, ast.cmpop),
    *(ast.IfExp, ast.Subscript, ast.Slice, ast.Attribute, ast.Call, ast.keyword),
    *(ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp, ast.comprehension),
)
_WORDS: dict[type[ast.AST], str] = {
    ast.Lambda: "a function of its own (lambda)",
    ast.JoinedStr: "an f-string",
    ast.NamedExpr: "an assignment (:=)",
    ast.Starred: "a star (*)",
}
#: What xacro has in its table `python`, and files for which nobody vouches have not.
_WITHHELD = ("vars",)
#: Kinds of values whose `python.type` they may ask for: other classes, called, make more than data.
_DATA = (bool, int, float, complex, str, list, tuple, dict, set, type(None))
#: Of Python's functions those that $(eval ...) may call.
_BUILTINS = (
    *("abs", "all", "any", "bool", "dict", "divmod", "enumerate", "float", "int", "len", "list", "map"),
    *("max", "min", "range", "round", "set", "sorted", "str", "sum", "tuple", "zip"),
)

#: The names under which expressions have the methods of `Operations`; with the blank no file can write them.
_NAMES = {
    name: f"nmm {name}"
    for name in (
        *("each", "called", "took", "power", "times", "plus", "modulo", "shift", "display", "attribute"),
    )
}
_OPERATORS: dict[type[ast.operator], str] = {
    ast.Pow: "power",
    ast.Mult: "times",
    ast.Add: "plus",
    ast.Mod: "modulo",
    ast.LShift: "shift",
}


class Operations:
    """The operations of expressions that may grow or lead elsewhere, with the budget that they ask."""

    def __init__(self, budget: Budget, xacro: Any) -> None:
        self._tables, self._wrapped = xacro.NameSpace, xacro.YamlDictWrapper
        self.methods = {name: getattr(budget, method, None) for method, name in _NAMES.items()}
        self.methods[_NAMES["attribute"]] = self._attribute

    def _attribute(self, value: Any, name: str) -> Any:
        """`value.name` of xacro's tables and of YAML's mappings; nothing else has a dot."""
        if isinstance(value, self._tables):
            try:
                return value[name]
            except KeyError:
                if name in _WITHHELD:
                    raise untrusted(f"python.{name}", name) from None
                raise NameError(f"name '{name}' is not defined") from None
        if isinstance(value, self._wrapped):
            return value[name]
        raise untrusted(f".{name} of a {type(value).__name__}", f".{name}")


class _Counted(ast.NodeTransformer):
    """An expression that asks a budget before it grows, and, unless it is trusted, for each dot."""

    def __init__(self, trusted: bool) -> None:
        self._trusted = trusted

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        name = _OPERATORS.get(type(node.op))
        return node if name is None else _call(name, node.left, node.right)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        return ast.Call(ast.Name(_NAMES["called"], ast.Load()), [node.func, *node.args], node.keywords)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        self.generic_visit(node)
        return node if self._trusted else _call("attribute", node.value, ast.Constant(node.attr))

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        self.generic_visit(node)  # `in` goes through all that there is
        node.comparators = [
            _call("took", item) if isinstance(operator, ast.In | ast.NotIn) else item
            for operator, item in zip(node.ops, node.comparators, strict=True)
        ]
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        self.generic_visit(node)  # a slice copies; an item by its number or name does not
        return node if isinstance(node.slice, ast.Constant) else _call("took", node)

    def visit_comprehension(self, node: ast.comprehension) -> ast.comprehension:
        self.generic_visit(node)
        node.iter = _call("each", node.iter)
        return node

    def _display(self, node: Any) -> ast.expr:
        self.generic_visit(node)
        made: ast.expr = node
        return _call("display", made) if isinstance(getattr(node, "ctx", ast.Load()), ast.Load) else made

    visit_List = visit_Tuple = visit_Dict = visit_Set = visit_ListComp = visit_DictComp = _display


def _call(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(_NAMES[name], ast.Load()), [*arguments], [])


def compiled(text: str, filename: str, mode: str) -> Any:
    return _compiled(text, filename, mode, is_trusted())


@lru_cache(maxsize=10_000)
def _compiled(text: str, filename: str, mode: str, trusted: bool) -> Any:
    if len(text) > LONGEST_EXPRESSION:
        raise BeyondBound("characters in an expression", LONGEST_EXPRESSION)
    tree = ast.parse(text, filename, mode)
    if not trusted:
        _check(tree, text)
    return compile(ast.fix_missing_locations(_Counted(trusted).visit(tree)), filename, mode)


def _check(tree: ast.AST, text: str) -> None:
    for node in ast.walk(tree):
        if not isinstance(node, _NODES) or isinstance(node, ast.MatMult):
            raise untrusted(_WORDS.get(type(node), type(node).__name__), text)
        name = getattr(node, "attr", getattr(node, "id", getattr(node, "arg", None)))
        if isinstance(name, str) and name.startswith("__"):
            raise untrusted(f"the name {name}", text)


def evaluated(operations: Operations, text: str, names: Any) -> Any:
    """The value of $(eval ...), with `names` and functions of Python: all where the file is trusted."""
    own = {name: getattr(builtins, name) for name in _BUILTINS}
    table = {} if is_trusted() else {"__builtins__": own}
    return eval(compiled(text.strip(), "<eval>", "eval"), {**operations.methods, **table}, names)


def symbols(xacro: Any, operations: Operations) -> dict[str, Any]:
    """The names that expressions of a file have, xacro's and ours."""
    names = {**xacro._global_symbols, **operations.methods}
    if not is_trusted():
        for table in ("python", "xacro"):
            names[table] = xacro.NameSpace()
            names[table].update({k: v for k, v in xacro._global_symbols[table].items() if k not in _WITHHELD})
        names["python"].update({"type": _type})
        names["xacro"].update({"tokenize": _tokens(xacro.tokenize)})
    return names


def _type(value: Any) -> Any:
    if not isinstance(value, _DATA):
        raise untrusted(f"python.type of a {type(value).__name__}", "type")
    return type(value)


def _tokens(tokenize: Any) -> Any:
    """xacro's `tokenize`, whose separators become a pattern: no other pattern may follow them."""

    def tokens(text: str, sep: str = ",; ", skip_empty: bool = True) -> Any:
        if re.search(r"[]\\[]", sep):
            raise untrusted(f"separators that are a pattern ({sep!r})", "tokenize")
        return tokenize(text, sep, skip_empty)

    return tokens
