"""Meshes and packages that are not where a file says, but near it; packages by their names."""

from __future__ import annotations

from pathlib import Path

import pytest
from findings import holds, of_code
from urdf_parts import link, robot, shape, write

import nmm
from nmm.cli.exit_status import status_of
from nmm.model.robots.loading.report import file_report

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
XACRO = 'name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"'


def described(folder: Path, mesh: str) -> Path:
    """robot/urdf/r.urdf, which names a mesh; m.obj is in robot/meshes/visual and beside the file."""
    for place in ("robot/meshes/visual", "robot/urdf"):
        (folder / place).mkdir(parents=True, exist_ok=True)
        write(folder / place / "m.obj", MESH)
    return write(folder / "robot/urdf/r.urdf", robot(link("a", shape(f'<mesh filename="{mesh}"/>'))))


@pytest.mark.parametrize(
    ("mesh", "place"),
    [
        ("package://renamed_description/meshes/visual/m.obj", "robot/meshes/visual/m.obj"),
        ("file://meshes/visual/m.obj", "robot/meshes/visual/m.obj"),
        ("file:///home/nobody/ros/meshes/visual/m.obj", "robot/meshes/visual/m.obj"),
        ("meshes/visual/m.obj", "robot/meshes/visual/m.obj"),
        ("../../elsewhere/meshes/visual/m.obj", "robot/meshes/visual/m.obj"),
        ("package:///m.obj", "robot/urdf/m.obj"),
    ],
)
def test_a_mesh_is_found_above_the_file_and_told(tmp_path: Path, mesh: str, place: str) -> None:
    path = described(tmp_path, mesh)
    loaded = nmm.load(path)
    (only,) = loaded.shapes.visual_model.geometryObjects
    assert only.meshPath == str(tmp_path / place)
    values = {"count": 1, "name": mesh, "place": str(tmp_path / place)}
    assert holds(of_code(loaded.notes, "found_nearby")[0], "found_nearby", **values)
    assert of_code(file_report(path).warnings, "found_nearby")


@pytest.mark.parametrize("mesh", ["package://renamed/visual/n.obj", "../m.obj", "http://m.obj", "m.stl"])
def test_other_meshes_are_missing(tmp_path: Path, mesh: str) -> None:
    path = described(tmp_path, mesh)
    (tmp_path / "robot/urdf/m.obj").unlink()
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(path)
    assert caught.value.findings[0].code == "mesh_missing"


def test_a_package_is_found_by_what_the_file_names_in_it(tmp_path: Path) -> None:
    """As ABB's and KUKA's files have them, copied from packages into folders of other names."""
    (tmp_path / "kuka/urdf").mkdir(parents=True)
    write(
        tmp_path / "kuka/urdf/macro.xacro",
        robot('<xacro:macro name="m"><link name="a"/></xacro:macro>', attributes=XACRO),
    )
    include = '<xacro:include filename="$(find kr6_support)/urdf/macro.xacro"/><xacro:m/>'
    path = write(tmp_path / "kuka/urdf/kr6.xacro", robot(include, attributes=XACRO))
    assert holds(
        of_code(nmm.load(path).notes, "found_nearby")[0], "found_nearby", place=str(tmp_path / "kuka")
    )
    write(path, robot(include.replace("macro.xacro", "other.xacro"), attributes=XACRO))
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(path)
    assert caught.value.findings[0].code == "package_missing"


@pytest.mark.parametrize(("folder", "found"), [("k", True), ("k/robots", True), ("k/robots/more", False)])
def test_a_bare_name_is_no_package_far_above(tmp_path: Path, folder: str, found: bool) -> None:
    (tmp_path / folder).mkdir(parents=True)
    write(tmp_path / "k/a", robot('<xacro:macro name="m"><link name="a"/></xacro:macro>', attributes=XACRO))
    include = '<xacro:include filename="$(find k_support)/a"/><xacro:m/>'
    path = write(tmp_path / folder / "k.xacro", robot(include, attributes=XACRO))
    if found:
        assert of_code(nmm.load(path).notes, "found_nearby")[0].values["place"] == str(tmp_path / "k")
    else:
        with pytest.raises(nmm.RobotError) as caught:
            nmm.load(path)
        assert [one.code for one in caught.value.findings] == ["package_missing"]


def test_the_folder_of_a_package_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    write(tmp_path / "mine/m.obj", MESH)
    path = write(tmp_path / "r.urdf", robot(link("a", shape('<mesh filename="package://theirs/m.obj"/>'))))
    loaded = nmm.load(path, package_dirs=["theirs=mine"])
    assert loaded.parts.provenance.packages == {"theirs": tmp_path / "mine"}
    assert status_of(["check", "r.urdf", "--package-dir", "theirs=mine"]) == 0
    assert "theirs in " in capsys.readouterr().out
    with pytest.raises(nmm.RobotError, match="is no folder"):
        nmm.load(path, package_dirs=["theirs=yours"])


def test_info_takes_arguments_of_a_xacro_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = robot('<xacro:arg name="n" default="a"/>', link("$(arg n)"), attributes=XACRO)
    path = write(tmp_path / "r.urdf.xacro", text)
    assert status_of(["info", str(path), "-a", "n=mast", "--platform", "unicycle"]) == 0
    assert "mast" in capsys.readouterr().out


def test_a_file_of_one_macro_is_that_macro_called(tmp_path: Path) -> None:
    macro = '<xacro:macro name="arm" params="PARAMS"><link name="${side}_a"/></xacro:macro>'
    path = write(tmp_path / "arm.xacro", robot(macro.replace("PARAMS", "side:=left"), attributes=XACRO))
    assert "left_a" in nmm.load(path).frames
    assert "right_a" in nmm.load(path, arguments={"side": "right"}).frames
    with pytest.raises(nmm.RobotError, match="unknown xacro argument"):
        nmm.load(path, arguments={"colour": "red"})
    write(path, robot(macro.replace("PARAMS", "side length"), attributes=XACRO))
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(path)
    assert holds(caught.value.findings[0], "macro_parameters_missing", missing=["side", "length"])
    assert "left_a" in nmm.load(path, arguments={"side": "left", "length": 1}).frames
    write(path, robot(macro, macro.replace('"arm"', '"leg"'), attributes=XACRO))
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(path)
    assert set(caught.value.findings[0].values["macros"]) == {"arm", "leg"}
