"""Work that a robot's file asks for has bounds: a file beyond one is refused soon, by the bound's name."""

import time
from pathlib import Path

import pytest

import nmm
from nmm.model.robots.loading import budget

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
#: No bound takes longer to be met, s of processor.
SOON = 15.0
ROW = "".join(
    f'<joint name="j{k}" type="fixed"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
    for k in range(1_001)
)
LINKS = "".join(f'<link name="l{k}"/>' for k in range(1_002))
WIDE = "".join(
    f'<link name="w{k}"/><joint name="v{k}" type="continuous"><parent link="l"/><child link="w{k}"/></joint>'
    for k in range(501)
)


def valued(expression: str) -> str:
    return f'<link name="a"/><material name="${{{expression}}}"/>'


def evaluated(expression: str) -> str:
    return f'<link name="a"/><material name="$(eval {expression})"/>'


BEYOND = {
    "power": (valued("2**999999"), "bits in an integer"),
    "power of eval": (evaluated("9**99999"), "bits in an integer"),
    "shift": (valued("1 &lt;&lt; 10**9"), "bits in an integer"),
    "string": (valued("'a' * 10**9"), "characters and items for xacro"),
    "list": (valued("[0] * 10**9"), "characters and items for xacro"),
    "range": (valued("[i for i in range(10**9)]"), "characters and items for xacro"),
    "loops": (valued("[0 for i in range(9999) for j in range(9999)]"), "xacro"),
    "length": (valued("1" + " + 1" * 10_000), "characters in an expression"),
    "macros that multiply": (
        '<xacro:macro name="m0" params="p"><link name="a${p}"/></xacro:macro>'
        + "".join(
            f'<xacro:macro name="m{k + 1}" params="p">'
            f'<xacro:m{k} p="${{p}}0"/><xacro:m{k} p="${{p}}1"/></xacro:macro>'
            for k in range(40)
        )
        + '<xacro:m40 p=""/>',
        "xacro",  # steps or seconds, as the machine is
    ),
    "in a row": (LINKS + ROW, "in a row"),
    "moving": ('<link name="l"/>' + WIDE, "move"),
    "elements": ("<a/>" * 200_001, "elements"),
}


@pytest.mark.parametrize(("text", "what"), BEYOND.values(), ids=BEYOND)
def test_beyond_a_bound_a_file_is_refused_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, what: str
) -> None:
    if what == "xacro":  # another bound is met however long xacro takes until then
        monkeypatch.setattr(budget, "PATIENCE", 0.5)
    file = tmp_path / "robot.xacro"
    file.write_text(f"{HEAD}{text}</robot>", encoding="utf-8")
    began = time.process_time()
    with pytest.raises(nmm.RobotError) as found:
        nmm.load(file, platform="unicycle")
    assert time.process_time() - began < SOON
    codes = {one.code: one.values for one in found.value.findings}
    assert what in codes["beyond_bound"]["what"]
    assert len(str(found.value)) <= 300


def test_includes_that_multiply_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "PATIENCE", 0.5)
    for k in range(40):
        inside = 2 * f'<xacro:include filename="{k + 1}.xacro"/>' if k < 39 else ""
        (tmp_path / f"{k}.xacro").write_text(f"{HEAD}{inside}</robot>", encoding="utf-8")
    with pytest.raises(nmm.RobotError) as found:
        nmm.load(tmp_path / "0.xacro", platform="unicycle")
    assert "beyond_bound" in {one.code for one in found.value.findings}


@pytest.mark.parametrize("expression", ["2**60", "[i * i for i in range(100)]", "'ab' * 10", "1 &lt;&lt; 20"])
def test_what_robots_ask_for_is_computed(tmp_path: Path, expression: str) -> None:
    file = tmp_path / "robot.xacro"
    file.write_text(f"{HEAD}{valued(expression)}</robot>", encoding="utf-8")
    assert nmm.load(file, platform="fixed").n == 0
