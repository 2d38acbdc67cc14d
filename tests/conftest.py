"""What the tests share."""

from __future__ import annotations

import gc
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from expanding import expand, expanded_once
from gripping import folding
from site_pages import built
from spatial_arms import load_tiago, load_ur5

from nmm.model.robots.loading import description, load
from nmm.model.robots.robot import Robot


def pytest_configure() -> None:
    """A shell's "&" has SIGINT ignored, by the commands, too, that the tests interrupt."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    gc.disable()  # what is collected stays


def pytest_collection_finish() -> None:
    """Thousands of tests and their modules stay to the end: to look for garbage among them, again and again,
    would take a tenth of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000)
    gc.enable()


#: Files of `pytest -m quick`: those that catch most faults in about a minute together.
QUICK = re.findall(
    r"\w+",
    """
    cli_robots collisions_distances controller controller_input controller_use
    damaged_folders errors findings findings_analysis findings_robot_file functions
    idle_inputs judging lazy_call limits limits_input linear_algebra platform_fit platform_input
    record_layout resolvers sampled samples scenario_keys scenario_spatial
    session settling simulation skid_steer spatial_functions stepping
    wheeled_description wheeled_platform
    """,
)
#: Tests of these files that take more than a second, most of them in processes of their own.
LONGER = re.findall(
    r"\w+",
    """
    a_target_that_has_changed_since_is_not_tried an_interrupt_while_it_is_tried_is_one
    damage_is_named folders_of_other_versions_keep_their_sentences
    messages_are_one_line_of_at_most_300_characters nothing_is_tried_before_somebody_reads
    summary_json_has_codes_and_values who_reads_does_not_disturb_the_controller
    """,
)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """`pytest -m quick` imports no other files."""
    if config.option.markexpr == "quick" and collection_path.suffix == ".py":
        return collection_path.stem.removeprefix("test_") not in QUICK or None
    return None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what `pytest -m quick` selects, what has a browser, and what needs the site and has none."""
    for item in items:
        if item.path.stem.removeprefix("test_") in QUICK:
            name = item.name.partition("[")[0].removeprefix("test_")
            if name not in LONGER:
                item.add_marker("quick")
        fixtures = getattr(item, "fixturenames", ())
        if "browser" in fixtures:
            item.add_marker("browser")
        elif "site" in fixtures:
            item.add_marker("thorough")


@pytest.fixture(scope="session", autouse=True)
def _bundled_robots_are_expanded_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(description, "expand", expanded_once)
        yield


@pytest.fixture
def xacro_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of the loading itself."""
    monkeypatch.setattr(description, "expand", expand)


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
