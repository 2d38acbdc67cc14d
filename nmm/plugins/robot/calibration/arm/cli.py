"""What `nmm calibrate` does with sightings of an arm."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.base.errors import InputError, expect
from nmm.cli.options import names_of, option
from nmm.cli.output import warn
from nmm.plugins.robot.cli import is_bag

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
        "The logs are sightings of an arm: the frame that carries what is seen. A posture is a row of a "
        "table (points x, y, z; poses, with qx, qy, qz, qw; corners u1, v1, ...) or, in a bag, wherever the "
        "arm stands.",
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

    def read(
        self,
        files: Sequence[str],
        robot: Robot,
        reference: Sequence[str] | None,
        of_tables: Mapping[str, Any],
        of_bags: Mapping[str, Any],
    ) -> list[Sightings]:
        """The sightings in tables and bags, by their files' names, with folders where two are the same."""
        paths = [Path(file) for file in files]
        each = {
            name: one_each(asked, files, f"--{name}")
            for name, asked in (("reference", reference), ("sensor", self.sensor), ("target", self.target))
        }
        both = [(path, seen if is_bag(str(path)) else None)
                for path, seen in zip(paths, each["reference"], strict=True)]  # fmt: skip
        for k, once in enumerate(both):
            expect(once not in both[:k], files[k], "each log once, a bag once for each --reference")
        if reference is not None and not any(map(is_bag, files)):
            what = "it is of bags: what is seen is in a table's own columns"
            raise InputError(what, where="--reference")
        several = [path.name for path in paths]
        logs = []
        for k, (path, file) in enumerate(zip(paths, files, strict=True)):
            name = path.name if several.count(path.name) == 1 else path.as_posix()
            own = {"name": name} | {option: values[k] or "" for option, values in each.items()}
            seen = own.pop("reference") or None
            if is_bag(file):
                logs.append(self._read_bag(file, robot, {"reference": seen, **own, **of_bags}))
            else:
                logs.append(self._read_table(file, robot, {**own, **of_tables}))
        return logs

    def _read_table(self, file: str, robot: Robot, keywords: Mapping[str, Any]) -> Sightings:
        from nmm.plugins.robot.calibration.arm.sightings import WORLD, Sightings

        assert self.on is not None  # `asked` has said so
        for name in ("time", "reference_time", "shift"):
            if name in keywords:
                where = f"--{name.replace('_', '-')}"
                raise InputError("it is of drives", where=where, expected="nothing: postures have no times")
        of_camera: dict[str, Any] = {"camera": self.camera, "board": self.board}
        with telling(keywords["name"]):
            return Sightings.from_csv(file, robot, self.on, self.by or WORLD, **of_camera, **keywords)

    def _read_bag(self, file: str, robot: Robot, keywords: Mapping[str, Any]) -> Sightings:
        from nmm.plugins.robot.calibration.arm.sightings import WORLD, Sightings

        assert self.on is not None  # `asked` has said so
        for name in ("camera", "board"):
            if getattr(self, name) is not None:
                expected = "poses of what a camera sees, or corners in a table"
                raise InputError("a bag has no corners", where=f"--{name}", expected=expected)
        with telling(keywords["name"]), _by_options():
            return Sightings.from_bag(file, robot, self.on, self.by or WORLD, **keywords)

    def learn(
        self, robot: Robot, logs: Sequence[Sightings], held: Mapping[str, float | None], tell: Progress | None
    ) -> ArmCalibration:
        """What the sightings say."""
        from nmm.plugins.robot.calibration.arm.calibration import calibrate_arm

        ratios: Any = () if self.ratios is None else True
        if self.ratios not in (None, "all"):
            ratios = names_of(self.ratios, "--ratios", "JOINT, JOINT, ..., or all")
        with _by_options():
            return calibrate_arm(robot, logs, held, ratios, tell)


@contextmanager
def telling(name: str) -> Iterator[None]:
    """What reading a log in the block warns of is told, with the log's name."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RuntimeWarning)
        yield
    for warning in caught:
        warn(f"{name}: {str(warning.message).removeprefix(f'{name}: ')}")


def one_each(asked: Sequence[str] | None, logs: Sequence[str], where: str) -> list[str | None]:
    """What an option says of each log, where it is given once for all, or for each."""
    values = [*(asked or [])]
    if len(values) in (0, 1):
        return [values[0] if values else None] * len(logs)
    expect(len(values) == len(logs), where, f"one, or one for each of {len(logs)} logs", len(values))
    return [*values]


@contextmanager
def _by_options() -> Iterator[None]:
    """What parameters should have been is told as options: "--seen-by camera_optical_frame"."""
    try:
        yield
    except InputError as error:
        text = re.sub(r"\b(on|by)='([^']*)'", r"--seen-\1 \2", error.expected)
        text = re.sub(r"\b(hold)='([^']*)'", r"--\1 \2", text)
        text = re.sub(r"\bbase=", "columns base_x, base_y, base_theta", text)
        text = re.sub(r"\b(sensor|target)=", r"--\1", text)
        raise error.placed(error.where, expected=text) from None
