"""What is advised about wheels that slide, by how they roll, and about hitches."""

from __future__ import annotations

from pathlib import Path

import pytest
from findings import of_code
from urdf_parts import joint, link, robot, write

import nmm
from nmm.model.robots.loading.report import file_report

PLACES = {"a": (0.3, 0.2), "b": (0.3, -0.2), "c": (-0.3, 0.2), "d": (-0.3, -0.2)}


def wheeled(axes: dict[str, str], places: dict[str, tuple[float, float]] = PLACES) -> str:
    parts = [link("base")]
    for name, axis in axes.items():
        x, y = places[name]
        body = f'<axis xyz="{axis}"/><limit effort="1" velocity="9"/>'
        parts.append(joint(f"{name}_wheel", "base", name, "continuous", body, f'<origin xyz="{x} {y} 0.1"/>'))
        parts.append(link(name))
    return robot(*parts)


@pytest.mark.parametrize(
    ("axes", "roll", "advised", "platform"),
    [
        (dict.fromkeys(PLACES, "0 1 0"), "ahead", "skid_steer", "skid_steer"),
        (dict.fromkeys(PLACES, "1 0 0"), "aside", "--axle X,Y,Z,YAW", "skid_steer"),
        (
            {"a": "0 1 0", "b": "0.866 -0.5 0", "c": "-0.866 -0.5 0"},
            "apart",
            "--platform omnidirectional",
            "omnidirectional",
        ),
    ],
    ids=["on two axles", "along y", "as an omni base has them"],
)
def test_the_advice_is_for_the_way_they_roll(
    tmp_path: Path, axes: dict[str, str], roll: str, advised: str, platform: str
) -> None:
    """Of a unicycle that is asked for; the file's own platform has no wheels that slide against it."""
    path = write(tmp_path / "r.urdf", wheeled(axes))
    (note,) = of_code(nmm.load(path, platform="unicycle", axle=(0.0, 0.0)).notes, "wheels_slide")
    assert note.values["roll"] == roll
    assert advised in str(note)
    report = file_report(path)
    assert not of_code(report.warnings, "wheels_slide")
    (note,) = of_code(report.warnings, "platform_recognized")
    assert note.values["platform"] == platform
    assert report.robot is not None
    assert report.robot.platform.name == platform


def test_a_train_is_told_of_the_tractor(tmp_path: Path) -> None:
    text = wheeled({"a": "0 1 0", "b": "0 1 0"}, {"a": (0.0, 0.2), "b": (0.0, -0.2)})
    upright = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
    spin = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'
    trailer = [joint("hitch_1", "base", "trailer", body=upright, origin='<origin xyz="-0.2 0 0.1"/>')]
    trailer += [link("trailer"), link("e")]
    trailer.append(joint("e_wheel", "trailer", "e", "continuous", spin, '<origin xyz="-0.6 0 0"/>'))
    path = write(tmp_path / "r.urdf", text.replace("</robot>", "".join(trailer) + "</robot>"))
    (found,) = of_code(file_report(path, platform="unicycle").warnings, "hitch_unused")
    assert found.values == {"name": "hitch_1"}
    report = file_report(path)
    assert not of_code(report.warnings, "hitch_unused")
    assert report.robot is not None
    assert report.robot.platform.name == "tractor"
