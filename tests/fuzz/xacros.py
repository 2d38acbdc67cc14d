"""Xacro and URDF that ask for much work: expressions that grow, macros, includes and properties that
multiply, long rows: refused in a line, or read, soon."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

import nmm
from nmm.base.errors import NmmError
from nmm.scenario.numbers import number

from .hunting import Hunt, refused

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
NUMBERS = st.sampled_from(
    ["0", "1", "2", "-3", "9", "0.5", "64", "999", "99999", "10**9", "1e308", "x", "x", "y"]
)


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    binary = st.tuples(inner, st.sampled_from(["**", "*", "<<", "+", "-", "/", "//", "%"]), inner)
    return st.one_of(
        binary.map(lambda parts: f"({' '.join(parts)})"),
        st.tuples(inner, inner).map(lambda parts: f"[{parts[0]} for i in range({parts[1]})]"),
        inner.map(lambda one: f"list(range({one}))"),
        inner.map(lambda one: f"('a' * {one})"),
        inner.map(lambda one: f"[{one}]"),
        inner.map(lambda one: f"factorial({one})"),
        inner.map(
            lambda one: (
                f"(lambda f, n: f(f, n))(lambda f, n: 1 if n &lt; 1 else f(f, n - 1) + f(f, n - 2), {one})"
            )
        ),
        inner.map(lambda one: f"python.sum(map(lambda k: k, range({one})))"),
    )


EXPRESSIONS = st.recursive(NUMBERS, _grown, max_leaves=6)
CASES = st.one_of(
    st.fixed_dictionaries({"kind": st.sampled_from(["value", "eval", "scenario"]), "text": EXPRESSIONS}),
    st.fixed_dictionaries(
        {
            "kind": st.sampled_from(
                ["macros", "blocks", "properties", "includes", "row", "tree", "attributes", "text"]
            ),
            "count": st.sampled_from([1, 2, 3, 10, 40, 300, 1_000, 1_001, 4_000, 20_000]),
            "times": st.integers(1, 4),
        }
    ),
)  # fmt: skip


def _macros(count: int, times: int, folder: Path) -> str:
    call = "".join(f'<xacro:m{{0}} p="${{{{p}}}}_{k}"/>' for k in range(times))
    made = '<xacro:macro name="m0" params="p"><link name="a${p}"/></xacro:macro>'
    made += "".join(
        f'<xacro:macro name="m{k + 1}" params="p">{call.format(k)}</xacro:macro>' for k in range(count)
    )
    return f'{made}<xacro:m{count} p=""/>'


def _blocks(count: int, times: int, folder: Path) -> str:
    made = (
        "<xacro:macro name='m' params='*b'><x>"
        + times * "<xacro:insert_block name='b'/>"
        + "</x></xacro:macro>"
    )
    return made + min(count, 60) * "<xacro:m>" + "<x/>" + min(count, 60) * "</xacro:m>"


def _properties(count: int, times: int, folder: Path) -> str:
    made = '<xacro:property name="p0" value="aa"/>'
    made += "".join(
        f'<xacro:property name="p{k + 1}" value="{times * f"${{p{k}}}"}"/>' for k in range(min(count, 100))
    )
    return f'{made}<link name="${{p{min(count, 100)}}}"/>'


def _includes(count: int, times: int, folder: Path) -> str:
    for k in range(min(count, 300)):
        inside = times * f'<xacro:include filename="{k + 1}.xacro"/>' if k + 1 < min(count, 300) else ""
        (folder / f"{k}.xacro").write_text(f"{HEAD}{inside}</robot>")
    return '<link name="a"/><xacro:include filename="0.xacro"/>'


def _row(count: int, times: int, folder: Path) -> str:
    kind = "fixed" if times > 2 else "continuous"
    made = "".join(f'<link name="l{k}"/>' for k in range(count + 1))
    return made + "".join(
        f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(count)
    )


def _tree(count: int, times: int, folder: Path) -> str:
    made = "".join(f'<link name="l{k}"/>' for k in range(count + 1))
    return made + "".join(
        f'<joint name="j{k}" type="fixed"><parent link="l{k // (times + 1)}"/>'
        f'<child link="l{k + 1}"/></joint>'
        for k in range(count)
    )


def _attributes(count: int, times: int, folder: Path) -> str:
    return f'<link name="a" {" ".join(f"a{k}={chr(34)}{times}{chr(34)}" for k in range(10 * count))}/>'


def _text(count: int, times: int, folder: Path) -> str:
    return f'<link name="a" at="{50 * count * "$$"}"/>{count * times * "<!--"}'


WRITE: dict[str, Callable[[int, int, Path], str]] = {
    "macros": _macros, "blocks": _blocks, "properties": _properties, "includes": _includes, "row": _row,
    "tree": _tree, "attributes": _attributes, "text": _text,
}  # fmt: skip


def check(case: Any) -> str:
    try:
        if case["kind"] == "scenario":
            number(case["text"].replace("x", "pi").replace("&lt;", "<"))
            return "a number"
        with tempfile.TemporaryDirectory() as folder:
            robot = Path(folder) / "robot.xacro"
            robot.write_text(f"{HEAD}{_inside(case, Path(folder))}</robot>")
            nmm.load(robot, platform="unicycle")
    except NmmError as error:
        return refused(error)
    return f"{case['kind']} loaded"


def _inside(case: Any, folder: Path) -> str:
    if case["kind"] in WRITE:
        return WRITE[case["kind"]](case["count"], case["times"], folder)
    given = '<xacro:property name="x" value="${7**30}"/><xacro:property name="y" value="abc"/>'
    text = f"${{{case['text']}}}" if case["kind"] == "value" else f"$(eval {case['text']})"
    return f'{given}<link name="a"/><material name="{text}"/>'


HUNT = Hunt("xacros", CASES, check)
