"""An arm's numbers beside what was seen of it: residuals, with their slopes in the numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.numbers import OFFSET, RATIO, robot_numbers, with_numbers
from nmm.model.robots.origins import ORIGIN, PARTS, arm_joints, joint_parts, movable_frames
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm.chain import Chain, MovedChain
from nmm.plugins.robot.calibration.arm.parameters import (
    mount_number,
    offset_number,
    origin_number,
    ratio_number,
)
from nmm.plugins.robot.calibration.arm.placements import carried, inverse, parts_of, placed, slopes
from nmm.plugins.robot.calibration.arm.residuals import left
from nmm.plugins.robot.calibration.arm.sightings import Sightings
from nmm.plugins.robot.calibration.arm.view import Block, ResidualRows, SightingsView
from nmm.plugins.robot.calibration.parameters import Learned


class ArmModel:
    """What may be learned of an arm by some sightings; where a target's place on its frame is `known`, the
    frame's own, too.

    learned : the numbers, in order; `first` (n,) : their values at first; `scales` (n,) : how far from these
    they may lie; flipped : joints whose readings count the other way; turns : by a mount's name the turn (3,
    3) behind which its angles are counted, which keeps them away from where roll and yaw are one
    groups : (log's index, "place", "turn" or "pixel") of each noise
    """

    def __init__(
        self,
        robot: Robot,
        logs: Sequence[Sightings],
        ratios: Collection[str] = (),
        where: str = "",
        known: Collection[str] = (),
    ) -> None:
        self.robot, self.where, self._targets = robot, where, known
        self._movable = {*movable_frames(robot)}
        ends = {end for log in logs for end in (log.by, log.on) if end in self._movable}
        self._known = {name: number.value for name, number in robot_numbers(robot, [*ends]).items()}
        own = (*arm_joints(robot), *ends)
        self._unmoved = with_numbers(
            robot,
            {
                f"{ORIGIN}{name}.{part}": 0.0
                for name in own
                if name in robot.origins
                for part in PARTS
                if f"{ORIGIN}{name}.{part}" in self._known
            },
        )
        self.learned: list[Learned] = []
        self.turns: dict[str, Array] = {}
        self.flipped: set[str] = set()
        self._mounts: dict[str, tuple[str, str]] = {}
        self.views: list[SightingsView] = []
        for log in logs:
            self.views.append(self._view(log))
        self._joints: dict[int, dict[str, int]] = {}
        self._add_joints(ratios)
        self.first = np.array([number.value for number in self.learned])
        self.scales = np.array([number.plausible for number in self.learned])
        self.groups = [(i, kind) for i, view in enumerate(self.views) for kind in dict.fromkeys(view.groups)]

    def index(self, name: str) -> int:
        """The place of a number among all; -1 without it."""
        return next((i for i, number in enumerate(self.learned) if number.name == name), -1)

    def in_group(self, name: str) -> list[int]:
        """The numbers of a name, or of a group of names: "origin" of all joints, "origin.q2", "tracker"."""
        return [
            i
            for i, number in enumerate(self.learned)
            if number.name == name
            or (number.name.startswith(f"{name}.") and not (name == "origin" and number.role == "frame"))
        ]

    def numbers(self, values: Array) -> dict[str, float]:
        """Those of the robot, by name."""
        stated = self.stated(values).tolist()
        return {n.name: x for n, x in zip(self.learned, stated, strict=True) if n.role != "mount"}

    def stated(self, values: Array) -> Array:
        """The numbers as they are told: angles of mounts that are counted behind a turn without it."""
        stated = values.copy()
        for block in self._blocks():
            if block.name in self.turns:
                at = parts_of(placed(self._parts(block, values), self.turns[block.name]))
                for part, i in block.numbers.items():
                    stated[i] = at[PARTS.index(part)]
        return stated

    def told_slopes(self, values: Array) -> Array:
        """(n, n): of `stated` in the numbers."""
        made = np.eye(len(values))
        for block in self._blocks():
            if block.name in self.turns:
                turn = self.turns[block.name]
                parts = self._parts(block, values)
                at = parts_of(placed(parts, turn))
                inner = np.linalg.pinv(slopes(at)) @ slopes(parts, turn)
                for part, i in block.numbers.items():
                    for other, j in block.numbers.items():
                        made[i, j] = inner[PARTS.index(part), PARTS.index(other)]
        return made

    def part(self, samples: Sequence[slice]) -> ArmModel:
        """The model of some samples of each log, with what is taken of them."""
        made = ArmModel.__new__(ArmModel)
        made.__dict__.update(self.__dict__)
        made.views = [
            SightingsView(
                view.log.part(some.start, some.stop),
                view.chain,
                view.readings[some],
                None if view.base is None else view.base[some],
                view.sensor,
                view.target,
                view.taken[some].copy(),
            )
            for view, some in zip(self.views, samples, strict=True)
        ]
        return made

    def placements(self, view: SightingsView, values: Array) -> tuple[MovedChain, Array, Array, Array]:
        """Of a log: placements of the chain, S and T of the mounts (4, 4), and of the target as the sensor
        sees it (N, 4, 4)."""
        moved = view.chain.moved(self._q(view, values), self._origins(view, values))
        S, T = (self.mounted(blocks, values) for blocks in (view.sensor, view.target))
        return moved, S, T, inverse(moved.by @ S) @ moved.on @ T

    def nominal(self, view: SightingsView, values: Array) -> Array:
        """`on` as `by` sees it (N, 4, 4), without mounts."""
        moved = view.chain.moved(self._q(view, values), self._origins(view, values))
        return inverse(moved.by) @ moved.on

    def rows(self, values: Array, free: Sequence[int] = ()) -> ResidualRows:
        """Residuals of what is taken, with slopes in the free numbers."""
        many = [self._left(view, values, free) for view in self.views]
        groups, samples, first, before = [], [], 0, 0
        for view, (r, _) in zip(self.views, many, strict=True):
            kinds = list(dict.fromkeys(view.groups))
            of = [first + kinds.index(kind) for kind in view.groups]
            groups.append(np.tile(np.array(of, dtype=np.int64), (*r.shape[:-1], 1)).ravel())
            samples.append(before + np.repeat(np.nonzero(view.taken)[0], r.shape[-1]))
            first, before = first + len(kinds), before + len(view.log)
        return ResidualRows(
            np.concatenate([r.ravel() for r, _ in many]),
            np.concatenate([J.reshape(r.size, len(free)) for r, J in many]),
            np.concatenate(groups),
            np.concatenate(samples),
        )

    def residuals(self, view: SightingsView, values: Array) -> Array:
        """Of all of a log, taken or not: (N, k), or (N, m, 2)."""
        return left(view.log, self.placements(view, values)[3])[0]

    def _left(self, view: SightingsView, values: Array, free: Sequence[int]) -> tuple[Array, Array]:
        """Residuals (K, k) and slopes (K, k, f) of the items that are taken."""
        moved, _, T, seen = self.placements(view, values)
        r, by_twist = left(view.log, seen)
        twists = self.twists(view, values, free, moved, T, seen)
        across = twists[:, np.newaxis] if view.log.kind == "corners" else twists
        J = by_twist @ across
        return r[view.taken], J[view.taken]

    def twists(
        self,
        view: SightingsView,
        values: Array,
        free: Sequence[int],
        moved: MovedChain,
        T: Array,
        seen: Array,
    ) -> Array:
        """Twists (N, 6, f) of the target as the sensor sees it, in the target's axes, for the free
        numbers."""
        made = np.zeros((len(seen), 6, len(free)))
        column = {i: k for k, i in enumerate(free)}
        behind = carried(inverse(T)[np.newaxis], np.eye(6))[0]
        for c, (offset, ratio) in self._zeros(view).items():
            if offset in column or ratio in column:
                by = view.chain.offset_twists(moved, view.chain.coordinates[c]) @ behind.T
                if offset in column:
                    made[:, :, column[offset]] = by
                if ratio in column:
                    sign = -1.0 if self.robot.q_names[view.chain.coordinates[c]] in self.flipped else 1.0
                    made[:, :, column[ratio]] = sign * by * view.readings[:, c : c + 1]
        for joint in view.chain.arm:
            index = self._joints[joint]
            if any(i in column for i in index.values()):
                all_parts = self._origins(view, values)[joint]
                by_parts = behind @ view.chain.origin_twists(moved, joint, all_parts)
                for part, i in index.items():
                    if i in column:
                        made[:, :, column[i]] = by_parts[:, :, PARTS.index(part)]
        rest = np.eye(4)
        for block in reversed(view.target):
            self._mount_twists(block, values, carried(inverse(rest)[np.newaxis], np.eye(6)), column, made)
            rest = placed(self._parts(block, values), self.turns.get(block.name)) @ rest
        rest = np.eye(4)
        for block in reversed(view.sensor):
            back = -carried(inverse(seen) @ inverse(rest), np.eye(6))
            self._mount_twists(block, values, back, column, made)
            rest = placed(self._parts(block, values), self.turns.get(block.name)) @ rest
        return made

    def _mount_twists(
        self, block: Block, values: Array, by: Array, column: Mapping[int, int], made: Array
    ) -> None:
        if not any(i in column for i in block.numbers.values()):
            return
        own = by @ slopes(self._parts(block, values), self.turns.get(block.name))
        for part, i in block.numbers.items():
            if i in column:
                made[:, :, column[i]] += own[:, :, PARTS.index(part)]

    def _q(self, view: SightingsView, values: Array) -> Array:
        coordinates = view.readings.copy()
        for c, (offset, ratio) in self._zeros(view).items():
            factor, more = self.robot.gear(self.robot.q_names[view.chain.coordinates[c]])
            factor = values[ratio] if ratio >= 0 else factor
            if self.robot.q_names[view.chain.coordinates[c]] in self.flipped:
                factor = -factor
            coordinates[:, c] = factor * coordinates[:, c] + (values[offset] if offset >= 0 else more)
        return view.chain.q(coordinates, view.base)

    def _zeros(self, view: SightingsView) -> dict[int, tuple[int, int]]:
        """By column of the readings the numbers of offset and ratio; -1 without."""
        names = [self.robot.q_names[c] for c in view.chain.coordinates]
        return {k: (self._at[OFFSET + name], self._at.get(RATIO + name, -1)) for k, name in enumerate(names)}

    def _origins(self, view: SightingsView, values: Array) -> dict[int, Array]:
        made = {}
        for joint in view.chain.arm:
            made[joint] = np.zeros(6)
            for part, i in self._joints[joint].items():
                made[joint][PARTS.index(part)] = values[i]
        return made

    def _parts(self, block: Block, values: Array) -> Array:
        parts = np.zeros(6)
        for part, i in block.numbers.items():
            parts[PARTS.index(part)] = values[i]
        return parts

    def mounted(self, blocks: Sequence[Block], values: Array) -> Array:
        """Where blocks put what is behind them, (4, 4)."""
        made = np.eye(4)
        for block in blocks:
            made = made @ placed(self._parts(block, values), self.turns.get(block.name))
        return made

    def _blocks(self) -> list[Block]:
        """All mounts, each once."""
        return [
            *{block.name: block for view in self.views for block in (*view.sensor, *view.target)}.values()
        ]

    def _view(self, log: Sightings) -> SightingsView:
        where = f"{self.where}: {log.name}"
        chain = Chain(self._unmoved, log.by, log.on, where)
        names = chain.names(chain.coordinates)
        missing = [name for name in names if name not in log.readings]
        if missing:
            what = f"no readings of {', '.join(missing)}"
            expected = f"those of all joints between {log.by} and {log.on}"
            raise InputError(what, where=where, expected=expected, available=log.readings)
        base = log.base if chain.on_platform else None
        readings = np.column_stack([log.readings[name] for name in names])
        parts = PARTS[:3] if log.kind == "points" else PARTS
        if log.own_frame and log.by in self._movable:
            sensor = self._block(f"{ORIGIN}{log.by}", PARTS, log.by, where, frame=True)
        else:
            sensor = self._block(log.sensor, PARTS, log.by, where)
        target = [self._block(log.target, parts, log.on, where)]
        if log.on in self._movable and log.target in self._targets:
            target.insert(0, self._block(f"{ORIGIN}{log.on}", PARTS, log.on, where, frame=True))
        return SightingsView(log, chain, readings, base, (sensor,), tuple(target), log.visible)

    def _block(
        self, name: str, parts: Sequence[str], frame_name: str, where: str, frame: bool = False
    ) -> Block:
        """The numbers of a mount, which are those that another log has given them."""
        role = (frame_name, "".join(parts))
        if self._mounts.setdefault(name, role) != role:
            other = self._mounts[name][0]
            what = f"{name} is on {frame_name} here, and on {other} in another log"
            raise InputError(what, where=where, expected="other names: sensor= or target=")
        index = {}
        for part in parts:
            i = self.index(f"{name}.{part}")
            if i < 0:
                i = len(self.learned)
                at = self._known.get(f"{name}.{part}", 0.0) if frame else 0.0
                self.learned.append(mount_number(f"{name}.{part}", part, at, frame))
            index[part] = i
        return Block(name, index)

    def _add_joints(self, ratios: Collection[str]) -> None:
        """The numbers of all joints that some log moves, from the base to the tip: zeros first."""
        robot = self.robot
        coordinates = sorted({c for view in self.views for c in view.chain.coordinates})
        for c in coordinates:
            name = robot.q_names[c]
            ratio, offset = robot.gear(name)
            self.learned.append(offset_number(OFFSET + name, name, robot.q_units[c], offset))
            if name in ratios:
                self.learned.append(ratio_number(RATIO + name, name, ratio))
        for view in self.views:
            for joint in view.chain.arm:
                if joint in self._joints:
                    continue
                name = view.chain.model.names[joint]
                self._joints[joint] = {}
                if name not in arm_joints(robot):
                    continue  # it follows another
                for part in joint_parts(robot, name):
                    self._joints[joint][part] = len(self.learned)
                    own = f"{ORIGIN}{name}.{part}"
                    self.learned.append(origin_number(own, name, part, self._known[own]))
        self._at = {number.name: i for i, number in enumerate(self.learned)}
