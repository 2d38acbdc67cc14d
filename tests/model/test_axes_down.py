"""Steering and hitch joints whose axes point down: the same robots as with the axes upwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from ackermann_car import car
from findings import assert_found, of_code
from urdf_parts import vehicle, write

import nmm


@pytest.mark.parametrize(("pivot", "x", "platform"), [("steering", 0.7, "car"), ("hitch", -0.2, "tractor")])
def test_it_is_the_robot_with_its_axis_upwards(tmp_path: Path, pivot: str, x: float, platform: str) -> None:
    asked = None if platform == "car" else platform
    up, down = (
        nmm.load(write(tmp_path / f"{name}.urdf", vehicle(pivot, x, name == "up")), platform=asked)
        for name in ("up", "down")
    )
    assert down.platform.name == up.platform.name == platform
    assert dict(down.platform.lengths) == dict(up.platform.lengths)
    assert down.q_names == up.q_names
    np.testing.assert_array_equal(down.q_limits, up.q_limits)
    np.testing.assert_array_equal(down.u_limits, up.u_limits)
    q = up.q({"x": 0.3, "theta": 0.2, pivot: 0.25, "q1": 0.4})
    np.testing.assert_array_equal(down.q({"x": 0.3, "theta": 0.2, pivot: 0.25, "q1": 0.4}), q)
    for frame in ("column", "flag", "arm"):
        ours, theirs = (nmm.Configuration(one, q).placement(frame).homogeneous for one in (down, up))
        np.testing.assert_allclose(ours, theirs, atol=1e-14)
    assert_found(of_code(down.notes, "joints_reversed"), ("joints_reversed", {"names": [pivot]}))
    assert not of_code(up.notes, "joints_reversed")


def test_two_steering_columns_without_one_between_make_a_car(tmp_path: Path) -> None:
    text = car(left=0.5, right=0.8)
    columns = '<axis xyz="0 0 1"/><limit effort="1" lower="{}" upper="{}"'
    turned = text
    for stop in (0.5, 0.8):
        turned = turned.replace(
            columns.format(-stop, stop), columns.format(-stop, stop).replace("0 0 1", "0 0 -1")
        )
    assert turned != text
    up, down = (nmm.load(write(tmp_path / f"{i}.urdf", one)) for i, one in enumerate((text, turned)))
    assert (down.platform.name, down.q_names) == ("car", up.q_names)
    np.testing.assert_array_equal(down.q_limits, up.q_limits)


def test_postures_and_models_of_the_file_keep_their_signs(tmp_path: Path) -> None:
    path = write(tmp_path / "r.urdf", vehicle("steering", 0.7, up=False))
    state = '<group_state name="left" group="all"><joint name="steering" value="-0.4"/></group_state>'
    write(tmp_path / "r.srdf", f'<robot name="r"><group name="all"/>{state}</robot>')
    loaded = nmm.load(path)
    assert loaded.postures["left"]["steering"] == 0.4
    model = pin.buildModelFromUrdf(str(path), pin.JointModelPlanar())
    layout = nmm.PinocchioLayout(loaded, model)
    q = loaded.q({"steering": 0.4})
    configuration = layout.configuration(q)
    assert configuration[model.joints[model.getJointId("steering")].idx_q] == -0.4
    np.testing.assert_allclose(layout.coordinates(configuration), q, atol=1e-15)
    rates = loaded.q({"steering": 0.2})
    velocity = layout.velocity(q, rates)
    np.testing.assert_allclose(layout.rates(configuration, velocity), rates, atol=1e-15)
    made = nmm.PinocchioLayout(loaded)
    np.testing.assert_allclose(made.coordinates(made.configuration(q)), q, atol=1e-15)
