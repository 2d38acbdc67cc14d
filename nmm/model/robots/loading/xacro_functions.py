"""xacro's functions, and Python's that its modules look up after their own, as a robot's file gets them: with
a budget, and, unless the file is trusted, without the environment and files elsewhere."""

from __future__ import annotations

import glob
import io
import os
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from nmm.base.files import read_bytes
from nmm.base.trust import is_trusted
from nmm.model.robots.loading.budget import LONGEST, LONGEST_YAML, BeyondBound, Budget
from nmm.model.robots.loading.expressions import Operations, compiled, evaluated, symbols
from nmm.model.robots.loading.packages import Packages
from nmm.model.robots.loading.trust import check_readable, untrusted

Replacement = tuple[Any, str, Any]
_QUOTED = re.compile("'[^']*'|\"[^\"]*\"")


def replacements(
    xacro: Any, budget: Budget, packages: Packages, find: Callable[[str], str]
) -> list[Replacement]:
    """Owner, name and value of what an expansion has in xacro's modules; `find` answers $(find NAME)."""
    operations = Operations(budget, xacro)

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

    def yaml_file(name: str) -> io.StringIO:
        check_readable(name, packages)
        return io.StringIO(read_bytes(Path(name), LONGEST_YAML).decode("utf-8-sig"))

    def matching(pattern: str) -> list[str]:
        check_readable(re.sub(r"[*?[\]]", "_", pattern), packages, pattern)
        return glob.glob(pattern)

    minidom = xacro.xml.dom.minidom
    clone = minidom._clone_node
    return [
        (minidom, "_clone_node", cloned),
        (xacro, "eval_all", elements),
        (xacro, "eval_text", text),
        (xacro, "safe_eval", lambda expression, *names: budget.took(evaluate(expression, *names))),
        (xacro, "parse_macro_arg", parameters),
        (xacro, "_global_symbols", symbols(xacro, operations)),
        (xacro, "compile", compiled),
        (xacro, "open", yaml_file),
        (xacro, "glob", SimpleNamespace(glob=matching)),
        (
            xacro.substitution_args,
            "eval",
            lambda expression, _, names: evaluated(operations, expression, names),
        ),
        *_functions(xacro.substitution_args, find),
    ]


def _functions(substitution_args: Any, find: Callable[[str], str]) -> list[Replacement]:
    """roslaunch's $(find ...), $(env ...) and $(optenv ...), and what $(eval ...) has of them."""
    functions: Mapping[str, Any] = {"find": find}
    if not is_trusted():
        functions = {"find": find, "env": _environment, "optenv": _environment_or}
    return [
        *((substitution_args, f"_eval_{name}", function) for name, function in functions.items()),
        (substitution_args, "_eval_dict", {**substitution_args._eval_dict, **functions}),
    ]


def _environment(name: str) -> str:
    raise untrusted(f"environment variable {name}", name)


def _environment_or(name: str, default: str = "") -> str:
    if name in os.environ:
        what = f"environment variable {name} is not read (--trust, trust=True)"
        print(f"warning: {what}: {default!r} is taken", file=sys.stderr)  # where xacro's own are collected
    return default
