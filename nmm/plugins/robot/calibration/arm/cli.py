"""What `nmm calibrate` does with sightings of an arm."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.base.errors import InputError, expect
from nmm.cli.options import names_of, option
from nmm.cli.output import warn

if TYPE_CHECKING:
    from nmm.base.progress import Progress
    from nmm.model.robots.robot import Robot
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration
    from nmm.plugins.robot.calibration.arm.sightings import Sightings


@dataclass(frozen=True)
class SightingOptions:
    """What was seen of an arm, and by what."""

    on: str | None = option(
        "FRAME|world",
        "The logs are sightings of an arm, a row a posture: the frame that carries what is seen (points x, "
        "y, z; poses, with qx, qy, qz, qw; corners u1, v1, ...).",
        "--seen-on",
        show="logs are of drives",
    )
    by: str | None = option(
        "FRAME|world",
        "What sees: the camera's own frame, or the world, where a tracker stands.",
        "--seen-by",
        show="world",
    )
    camera: str | None = option(
        "FILE", "Of corners the camera's intrinsics, as ROS's camera calibration writes them."
    )
    board: str | None = option(
        "COLUMNSxROWS:METRES", "Of corners the board, by its inner corners: 9x6:0.025."
    )
    sensor: list[str] | None = option(
        "NAME",
        "What sees, where the frame only carries it: its mount there is learned by this name. One for all "
        "logs, or one for each: of a tracker that was set up anew another name.",
    )
    target: list[str] | None = option(
        "NAME", "What is seen: its place is learned by this name. One for all logs, or one for each."
    )
    ratios: str | None = option("JOINT,...|all", "Joints whose gear ratio is learned, too.", show="none")

    @property
    def asked(self) -> bool:
        """Whether logs are sightings; `InputError` for options of sightings without them."""
        for name in ("by", "camera", "board", "sensor", "target", "ratios"):
            if self.on is None and getattr(self, name) is not None:
                shown = "--seen-by" if name == "by" else f"--{name}"
                raise InputError(
                    "it is of sightings of an arm", where=shown, expected="--seen-on FRAME beside it"
                )
        return self.on is not None

    def read(self, files: Sequence[str], robot: Robot, keywords: Mapping[str, Any]) -> list[Sightings]:
        """The sightings in tables, by their files' names, with folders where two are the same."""
        paths = [Path(file) for file in files]
        for k, path in enumerate(paths):
            expect(path not in paths[:k], files[k], "each log once")
        sensors, targets = (
            one_each(asked, files, where)
            for asked, where in ((self.sensor, "--sensor"), (self.target, "--target"))
        )
        several = [path.name for path in paths]
        logs = []
        for path, file, sensor, target in zip(paths, files, sensors, targets, strict=True):
            name = path.name if several.count(path.name) == 1 else path.as_posix()
            own = {"name": name, "sensor": sensor or "", "target": target or ""}
            logs.append(self._read(file, robot, own, keywords))
        return logs

    def _read(
        self, file: str, robot: Robot, own: Mapping[str, Any], keywords: Mapping[str, Any]
    ) -> Sightings:
        """The sightings in a table; what reading it found is told."""
        from nmm.plugins.robot.calibration.arm.sightings import WORLD, Sightings

        assert self.on is not None
        for name in keywords:
            if name not in ("units", "columns", "delimiter"):
                where = f"--{name.replace('_', '-')}"
                raise InputError("it is of drives", where=where, expected="nothing: postures have no times")
        of_camera: dict[str, Any] = {"camera": self.camera, "board": self.board}
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", RuntimeWarning)
            log = Sightings.from_csv(file, robot, self.on, self.by or WORLD, **of_camera, **own, **keywords)
        for warning in caught:
            warn(f"{log.name}: {warning.message}")
        return log

    def learn(
        self, robot: Robot, logs: Sequence[Sightings], held: Mapping[str, float | None], tell: Progress | None
    ) -> ArmCalibration:
        """What the sightings say."""
        from nmm.plugins.robot.calibration.arm.calibration import calibrate_arm

        ratios: Any = () if self.ratios is None else True
        if self.ratios not in (None, "all"):
            ratios = names_of(self.ratios, "--ratios", "JOINT, JOINT, ..., or all")
        try:
            return calibrate_arm(robot, logs, held, ratios, tell)
        except InputError as error:
            raise error.placed(error.where, expected=_as_options(error.expected)) from None


def one_each(asked: Sequence[str] | None, logs: Sequence[str], where: str) -> list[str | None]:
    """What an option says of each log, where it is given once for all, or for each."""
    given = [*(asked or [])]
    if len(given) in (0, 1):
        return [given[0] if given else None] * len(logs)
    expect(len(given) == len(logs), where, f"one, or one for each of {len(logs)} logs", len(given))
    return [*given]


def _as_options(expected: str) -> str:
    """What parameters should have been, as options: "--seen-by camera_optical_frame"."""
    text = re.sub(r"\b(on|by)='([^']*)'", r"--seen-\1 \2", expected)
    text = re.sub(r"\b(hold)='([^']*)'", r"--\1 \2", text)
    text = re.sub(r"\bbase=", "columns base_x, base_y, base_theta", text)
    return re.sub(r"\b(sensor|target)=", r"--\1", text)
