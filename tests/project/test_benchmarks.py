"""The benchmark's workloads are what they say, nmm tracks them, and its tables print."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import ROOT

sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "benchmarks" / "workers")]

# Scripts, and no package: they are found by the path above.
import contest  # noqa: E402  # after the path
import environments  # noqa: E402  # after the path
import growth  # noqa: E402  # after the path
import loop  # noqa: E402  # after the path
import of_nmm  # noqa: E402  # after the path
import tables  # noqa: E402  # after the path
import workloads  # noqa: E402  # after the path

NAMES = [*workloads.WORKLOADS]


@pytest.fixture(scope="module")
def laid() -> dict[str, workloads.Workload]:
    return {name: workloads.Workload(name) for name in NAMES}


@pytest.fixture(scope="module")
def told(laid: dict[str, workloads.Workload], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the workers read, the robots' texts in files."""
    folder = tmp_path_factory.mktemp("workloads")
    found = {name: one.describe() for name, one in laid.items()}
    for name, one in found.items():
        for base, text in one["urdf"].items():
            path = folder / f"{name}_{base}.urdf"
            path.write_text(text)
            one["urdf"][base] = str(path)
    return found


class LeastSquares(loop.Peer):
    """A library of ten lines: the displacement of least norm, by Pinocchio and NumPy."""

    def __init__(self, told: Any, base: str, limits: bool) -> None:
        super().__init__(told, base, limits)
        self.model = pin.buildModelFromUrdf(self.urdf)
        self.data = self.model.createData()
        self.id = self.model.getFrameId(self.frame)

    def jacobian(self) -> np.ndarray:
        return pin.computeFrameJacobian(self.model, self.data, self.q_all, self.id, pin.LOCAL_WORLD_ALIGNED)

    def displacement(self, T: np.ndarray) -> np.ndarray:
        J, found = self.jacobian(), self.data.oMf[self.id]
        error = np.concatenate([T[:3, 3] - found.translation, pin.log3(T[:3, :3] @ found.rotation.T)])
        rows = self.told["rows"]
        return np.asarray(np.linalg.lstsq(J[:rows], error[:rows], rcond=None)[0])


@pytest.mark.parametrize("name", NAMES)
def test_the_robot_in_the_text_is_the_workloads(
    name: str, laid: dict[str, workloads.Workload], told: dict[str, Any]
) -> None:
    workload, rng = laid[name], np.random.default_rng(3)
    slides = LeastSquares(told[name], "slides", False)
    q = rng.uniform(-1.0, 1.0, workload.robot.n)
    pin.framesForwardKinematics(slides.model, slides.data, q)
    expected = workload.placement(q)
    np.testing.assert_allclose(slides.data.oMf[slides.id].homogeneous, expected.homogeneous, atol=1e-14)
    names = workload.robot.q_names[3:]
    limits = [(*workload.coordinates[n], workload.inputs[n][1]) for n in names]
    model = slides.model
    found = zip(
        *(a[3:] for a in (model.lowerPositionLimit, model.upperPositionLimit, model.velocityLimit)),
        strict=True,
    )
    assert [*found] == limits


@pytest.mark.parametrize("name", NAMES)
def test_a_rolling_bases_jacobian_is_that_of_the_inputs(
    name: str, laid: dict[str, workloads.Workload], told: dict[str, Any]
) -> None:
    workload = laid[name]
    rolls = LeastSquares(told[name], "rolls", False)
    q = workload.q0
    robot, model = workload.robot, workload.robot.model
    data, axes = model.createData(), pin.LOCAL_WORLD_ALIGNED
    J = pin.computeFrameJacobian(model, data, q, robot.frame_id(workload.frame), axes)
    turn = pin.utils.rotate("z", -q[2])
    expected = np.kron(np.eye(2), turn) @ J @ robot.S(q)
    np.testing.assert_allclose(rolls.jacobian(), expected, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("base", ["rolls", "slides"])
def test_any_library_tracks_what_it_is_told(
    name: str, base: str, laid: dict[str, workloads.Workload], told: dict[str, Any]
) -> None:
    peer = LeastSquares(told[name], base, False)
    count = len(told[name]["positions"])
    path = [peer.q()]
    for k in range(count):
        peer.step(k)
        path.append(peer.q())
    found = contest.judge(laid[name], np.array(path), False)
    assert found.reason == ""
    assert found.position < 1e-4
    assert (found.sideways < 1e-12) == (base == "rolls")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kinematics", ["pinocchio", "compiled"])
def test_nmm_tracks_its_workloads_and_keeps_their_limits(
    name: str, kinematics: str, laid: dict[str, workloads.Workload]
) -> None:
    workload = laid[name]
    one = of_nmm.Nmm(workload, kinematics, True)
    one.reset()
    path = [one.q()]
    for k in range(len(workload.t)):
        one.step(k)
        path.append(one.q())
    found = contest.judge(workload, np.array(path), True)
    assert found.reason == ""
    assert found.position < 1e-3
    assert found.beyond < 1e-9
    assert found.sideways < 1e-12


def test_who_does_not_track_or_breaks_a_limit_has_no_time(laid: dict[str, workloads.Workload]) -> None:
    workload = laid["planar"]
    one = of_nmm.Nmm(workload, "compiled", False)
    one.reset()
    path = [one.q()]
    for k in range(len(workload.t)):
        one.step(k)
        path.append(one.q())
    q = np.array(path)
    assert contest.judge(workload, q, False).reason == ""
    assert "breaks a limit" in contest.judge(workload, q, True).reason
    off = q.copy()
    off[-1, 0] += 0.1
    assert "does not track" in contest.judge(workload, off, False).reason


def test_the_tables_tell_ratios_of_the_same_rounds_and_who_is_missing(tmp_path: Path) -> None:
    job = "planar, limits on"
    followed = {
        (job, "nmm", "pinocchio"): contest.Followed(5e-4, 0.0, 0.0, 0.0, ""),
        (job, "roboplan", "rolls"): contest.Followed(1e-5, 0.0, 0.0, 0.0, ""),
        (job, "Pink", "rolls"): contest.Followed(0.1, 0.0, 0.0, 0.0, "does not track"),
    }
    times = {(job, "nmm", "pinocchio"): [4.0, 8.0, 6.0], (job, "roboplan", "rolls"): [8.0, 16.0, 6.0]}
    absent = ["mink: pip: no such version"]
    sections = tables.comparison(times, followed, absent, {"nmm": {"nmm": "1"}}, ["a machine"], 3, {job: 500})
    printed = "\n".join(tables.text(one) for one in sections)
    assert "not run: mink: pip: no such version" in printed
    (compared,) = [one for one in sections if one.name == job]
    assert compared.rows[1][1:4] == ["8.00", "6.00", "2.00"]
    assert compared.rows[2][1:3] == ["does not track", ""]
    assert sections[-1].rows == [[job, "rolls", "pinocchio", "0.50 (0.50 to 0.75)", "at most 0.8", "yes"]]
    page = tmp_path / "page.md"
    page.write_text("".join(f"<!-- {one.name} -->\n<!-- end -->\n" for one in sections) + "after\n")
    tables.into(page, [one._replace(after=["old"]) for one in sections])
    tables.into(page, sections)
    assert "old" not in page.read_text()
    assert page.read_text().endswith("<!-- end -->\nafter\n")
    assert "| roboplan, its base rolls | 8.00 |" in page.read_text()


def test_the_page_has_a_place_for_every_table() -> None:
    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    for name in ("versions", *contest.all_jobs(), "aims", "rows", "inputs", "frames", "levels"):
        assert page.count(f"<!-- {name} -->\n") == 1


def test_an_environment_that_cannot_be_made_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: object, **__: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(environments.venv, "create", refuses)
    python, reason = environments.python_of(environments.LIBRARIES[0], tmp_path)
    assert python is None
    assert "no space left" in reason


def test_every_library_is_pinned() -> None:
    for library in environments.LIBRARIES:
        assert all("==" in package for package in library.packages)
        assert (contest.WORKERS / library.worker).exists()


def test_snake_arms_have_the_inputs_that_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "ROUNDS", 1)
    monkeypatch.setattr(growth, "SECONDS", 0.0)
    robot, q = growth.snakes(tmp_path, 3, 3)
    assert robot.n_u == 8
    tasks = [growth.task(robot, q, growth.nmm.Position(hand)) for hand in "ab"]
    ((said, *cells),) = growth.timed([("8, two arms", growth.calls(robot, q, tasks))])
    assert said == "8, two arms"
    assert len(cells) == len(growth.COLUMNS) + 1
