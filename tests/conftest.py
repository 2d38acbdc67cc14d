"""What the tests share."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from expanding import expanded_once
from gripping import folding
from site_pages import built
from spatial_arms import load_tiago, load_ur5

from nmm.robots.loading import description, load, xacro_file
from nmm.robots.robot import Robot


def pytest_configure() -> None:
    """A shell's "&" has SIGINT ignored, by the commands, too, that the tests interrupt."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _bundled_robots_are_expanded_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(description, "expand", expanded_once)
        yield


@pytest.fixture
def xacro_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of the loading itself."""
    monkeypatch.setattr(description, "expand", xacro_file.expand)


@pytest.fixture(scope="session")
def robot_2r() -> Robot:
    return load("unicycle_2r")


@pytest.fixture(scope="session")
def robot_3r() -> Robot:
    return load("unicycle_3r")


@pytest.fixture(scope="session")
def robots(robot_2r: Robot, robot_3r: Robot) -> dict[str, Robot]:
    return {robot.name: robot for robot in (robot_2r, robot_3r, folding())}


@pytest.fixture(scope="session")
def ur5() -> Robot:
    return load_ur5()


@pytest.fixture(scope="session")
def tiago() -> Robot:
    return load_tiago()


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the documentation's site."""
    return built(tmp_path_factory.mktemp("site"))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2006)


@pytest.fixture(autouse=True)
def _no_width_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever runs the tests may have said how wide a line is (pytest-xdist does)."""
    monkeypatch.delenv("COLUMNS", raising=False)
