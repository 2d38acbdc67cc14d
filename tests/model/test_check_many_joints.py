"""What `nmm check` takes grows with a robot's joints, not with their square: counted, not timed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType

import pinocchio as pin
import pytest
from urdf_parts import AXIS, LIMIT, inertial, joint, link, robot, shape, write

import nmm
from nmm.model.collisions.pairs import touching_links
from nmm.model.robots.loading.report import file_report

ACROSS = '<axis xyz="0 1 0"/>'


def chain(folder: Path, joints: int) -> Path:
    """The file of a chain of boxes, every other joint across the last."""
    box = inertial() + shape('<box size="0.12 0.12 0.12"/>', "collision")
    at = '<origin xyz="0.1 0 0.02"/>'
    between = [
        joint(f"j{i}", f"l{i}", f"l{i + 1}", "revolute", (AXIS, ACROSS)[i % 2] + LIMIT, at)
        for i in range(joints)
    ]
    boxes = [link(f"l{i}", box) for i in range(joints + 1)]
    return write(folder / f"chain{joints}.urdf", robot(*boxes, *between))


def calls_in(work: Callable[[], object]) -> int:
    """How many functions are called, Python's and others."""
    count = 0

    def called(frame: FrameType, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(called)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the pairs whose shapes are asked whether they touch, as they are asked."""
    numbers: list[int] = []
    through = pin.computeCollision

    def computed(model: pin.GeometryModel, data: pin.GeometryData, number: int) -> bool:
        numbers.append(number)
        return bool(through(model, data, number))

    monkeypatch.setattr(pin, "computeCollision", computed)
    return numbers


def test_twice_as_many_joints_take_twice_as_many_calls(tmp_path: Path) -> None:
    """To read a file, to say what is wrong with it, and to load it."""
    file_report(chain(tmp_path, 3), platform="fixed")  # what is imported and compiled once
    files = [chain(tmp_path, joints) for joints in (40, 80)]
    once, twice = (calls_in(partial(file_report, file, platform="fixed")) for file in files)
    assert 1.5 < twice / once < 2.5


def test_no_data_of_whole_models_are_made_to_load_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With Hessians in them, they grow with the cube of the joints: a third of a second for 190."""
    made: list[int] = []
    through = pin.Model.createData
    monkeypatch.setattr(pin.Model, "createData", lambda model: made.append(model.nv) or through(model))
    nmm.load(chain(tmp_path, 20), platform="fixed")
    assert made == []


def test_twice_as_many_links_are_asked_twice_as_often(tmp_path: Path, asked: list[int]) -> None:
    """Whether they touch: of all pairs those that are near, though there are four times as many."""
    counts, pairs = [], []
    for joints in (70, 140):
        found = touching_links(nmm.load(chain(tmp_path, joints), platform="fixed"), 30)
        pairs.append(len(found.shares))
        counts.append(len(asked))
        asked.clear()
    assert pairs[1] > 3.9 * pairs[0] > 3.9 * 2_000
    assert counts[0] < 0.2 * 30 * pairs[0]
    assert counts[1] < 2.8 * counts[0]


def test_pairs_that_are_far_apart_are_not_missed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They touch as often as where all are looked at, but where two just touch."""
    made = nmm.load(chain(tmp_path, 70), platform="fixed")
    near = touching_links(made, 50)
    monkeypatch.setattr("nmm.model.collisions.pairs.FEW_PAIRS", 10_000)
    whole = touching_links(made, 50)
    assert len(whole.shares) > 2_000
    differ = [pair for pair, share in whole.shares.items() if abs(share - near.shares[pair]) > 0.021]
    assert differ == []
    assert len(whole.sometimes) > 50
