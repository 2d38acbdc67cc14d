"""The singular configuration nearest to a given one, and what the command prints."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import twin
from numpy import pi
from numpy.typing import NDArray

from nmm.base.text_format import value_text
from nmm.cli.singularities import singularities
from nmm.control.functions.tasks import CallableFunction, Position
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic.search.family import values_text
from nmm.plugins.symbolic.search.nearest import nearest_singularity

Array = NDArray[np.float64]

XY = Position("ee", "xy")


@pytest.fixture(scope="module")
def planar() -> Robot:
    """A 2R arm on a base that does not move."""
    return load("unicycle_2r", platform="fixed")


def test_the_nearest_of_the_planar_2r(planar: Robot) -> None:
    for q2, expected in ((0.4, 0.0), (-1.0, 0.0), (3.5, pi), (6.0, 2 * pi)):
        q = planar.q({"q1": 0.7, "q2": q2})
        point = nearest_singularity((planar, XY), q, starts=20)
        assert point is not None
        assert point.distance == pytest.approx(abs(q2 - expected), abs=1e-9)
        assert point.changes == {"q2": pytest.approx(expected - q2, abs=1e-9)}
        assert point.pinned == {"q2": pytest.approx(expected, abs=1e-9)}
        assert "q1" in point.free
        assert np.linalg.svd(twin.Planar().J(np.array([0, 0, 0, *point.q[:2]]))[:, 2:])[1][-1] < 1e-9
    far = nearest_singularity((planar, XY), {"q2": 1.5}, starts=20, ranges={"q2": (0.5, 4.0)})
    assert far is not None
    assert far.q[planar.coordinate("q2")] == pytest.approx(pi)


def test_the_metric() -> None:
    """Lengths count in units of the characteristic length: with a long one it is cheaper to drive."""
    robot = load("unicycle_2r")

    def jacobian(configuration: Any) -> Array:
        q = configuration.q
        return np.array([[1.0, 0, 0, 0, 0], [0, 0, 0, q[0] + q[3] - 1.0, 0]])

    task = CallableFunction(lambda configuration: np.zeros(2), ["a", "b"], jacobian=jacobian)
    for length in (0.5, 1.0, 4.0):  # on x + q1 = 1 the nearest to 0 has x = L²/(1 + L²)
        point = nearest_singularity((robot, task), np.zeros(5), length=length, starts=20)
        assert point is not None
        assert point.q[0] == pytest.approx(length**2 / (1 + length**2), abs=1e-6)
        assert point.distance == pytest.approx(1 / np.hypot(1, length), rel=1e-9)


def test_values_as_people_write_them() -> None:
    assert values_text([0.0, pi], "rad", circular=True) == "0 or ±π"
    assert values_text([0.0, pi], "rad") == "0 or π"
    assert values_text([pi / 2, -pi / 2, 1.0], "rad") == "1 rad (57.3°) or ±π/2"
    assert values_text([-0.25], "m") == "-0.25 m"
    assert value_text(-3 * pi / 4, "rad") == "-3π/4"


def test_printed(capsys: pytest.CaptureFixture[str]) -> None:
    singularities(
        "unicycle_3r", task=["position"], at=["q2=0.3", "q3=0.4"], search=True, starts=40, nearest=True
    )
    out = capsys.readouterr().out
    assert "q2 = 0 or ±π; q3 = 0 or ±π" in out
    assert "x, y, theta, q1" in out
    assert "loses ee.z" in out
    assert "4 of 6" in out
    assert "of 40 starts" in out
    assert "distance 0.5" in out
    assert "-0.3 rad (-17.19°)" in out
    assert "no proof" in out
    singularities("unicycle_2r", task=["position"], search=True, starts=10, nearest=True)
    out = capsys.readouterr().out
    assert "no singular configuration of J found from 10 starts" in out
    assert "no singular configuration found near this one" in out
    assert "smallest σ_min" in out
