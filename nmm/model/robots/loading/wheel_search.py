"""Which joints are a base's wheels where names do not say it, and what stands still above them."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from nmm.model.platforms.wheel_layout import HITCHES, PARALLEL, Rollers, is_named
from nmm.model.robots.loading.joint_kinds import is_revolute
from nmm.model.robots.loading.measured_joints import Asked, Measured, Undercarriage, ends_of, expect_names

#: Joints at one point are nearer to each other than this, m.
_TOGETHER = 2e-3
#: So many joints around a wheel's rim are rollers, whatever they are called.
_ROLLERS = 3
#: Rollers whose axes lie nearer to the wheel's than this, rad, are aslant, as a mecanum wheel's.
_ASLANT = math.radians(67.5)
#: How far above the ground of the others a wheel may hang, as a share of its radius: below a spring or a
#: rocker, and on the base itself (a wheel to steer by hand hangs higher).
_SPRUNG, _HANGING = 1.0, 3.0
#: A wheel's radius where nothing tells it, m.
_USUAL = 0.1
#: Wheels whose names do not say it touch the ground to this share of their radius, and are as large as each
#: other to this share.
_ON_GROUND, _ALIKE = 0.3, 0.05


def find_undercarriage(measured: Measured, asked: Asked, own: Collection[str]) -> Undercarriage:
    """What stands still below a base, with joints `own` of its platform, `asked` as in `load`'s `wheels`."""
    expect_names(asked, measured.where)
    return _Search(measured, asked, frozenset(own)).undercarriage()


@dataclass(frozen=True, eq=False)
class _Search:
    measured: Measured
    asked: Asked
    own: frozenset[str]

    def undercarriage(self) -> Undercarriage:
        model = self.measured.model
        rollers = self._rollers()
        balls = self._balls()
        candidates = [joint for joint in self._candidates(rollers) if joint not in balls]
        direct = [joint for joint in candidates if not self._between(joint)]
        unnamed = [*self._unnamed(direct), *(joint for joint in direct if not self._is_meant(joint))]
        ground = self._ground([*direct, *unnamed] or candidates)
        aloft = [j for j in direct if not self._is_near(j, ground, _HANGING)] if self.asked is None else []
        wheels = [j for j in candidates if j not in aloft and (j in direct or self._hangs(j, ground))]
        parts = {*wheels, *unnamed, *balls, *(roller for some in rollers.values() for roller in some)}
        held = self._suspension(wheels, parts)
        held |= self._idle(wheels)
        held |= {roller for wheel, some in rollers.items() if wheel in parts for roller in some} | set(balls)
        names = {joint: str(model.names[joint]) for joint in range(model.njoints)}
        return Undercarriage(
            {names[joint]: self._rest(joint) for joint in sorted(held) if names[joint] not in self.own},
            tuple(names[joint] for joint in unnamed),
            {names[wheel]: self._kind_of(wheel, some) for wheel, some in rollers.items() if wheel in wheels},
            tuple(names[joint] for joint in aloft),
        )

    def _is_level(self, joint: int) -> bool:
        model = self.measured.model
        return is_revolute(model.joints[joint]) and abs(self.measured.axis(joint)[2]) <= PARALLEL

    def _is_meant(self, joint: int) -> bool:
        """Whether its name, or the caller, says that it is a wheel."""
        name = str(self.measured.model.names[joint])
        if self.asked is not None:
            return name in self.asked
        return name not in self.own and self.measured.is_named_wheel(joint)

    def _rollers(self) -> dict[int, list[int]]:
        """By wheel: the joints on its rim, each of which only turns."""
        rollers: dict[int, list[int]] = {}
        model = self.measured.model
        for wheel in range(self.measured.root + 1, model.njoints):
            some = self.measured.children(wheel)
            if len(some) < _ROLLERS or not self._is_level(wheel):
                continue
            centre, along = self.measured.placements[wheel].translation, self.measured.axis(wheel)
            away = [np.cross(self.measured.placements[roller].translation - centre, along) for roller in some]
            sizes = np.linalg.norm(away, axis=1)
            turn = all(
                is_revolute(model.joints[roller]) and not self.measured.children(roller) for roller in some
            )
            if turn and sizes.min() > _TOGETHER and np.ptp(sizes) < 0.1 * sizes.max():
                rollers[wheel] = some
        return rollers

    def _kind_of(self, wheel: int, rollers: list[int]) -> Rollers:
        along = self.measured.axis(wheel)
        cosines = [abs(float(self.measured.axis(roller) @ along)) for roller in rollers]
        return "mecanum" if math.acos(min(1.0, float(np.median(cosines)))) < _ASLANT else "omni"

    def _balls(self) -> list[int]:
        """Joints that roll one about another at one point: a ball, which rolls every way."""
        model, balls = self.measured.model, list[int]()
        for joint in range(self.measured.root + 1, model.njoints):
            if self.measured.children(joint):
                continue
            ball = [joint]  # from the last joint upwards, while each is the only one at the same point
            while (parent := int(model.parents[ball[-1]])) > self.measured.root:
                apart = np.linalg.norm(model.jointPlacements[ball[-1]].translation)
                if (
                    apart > _TOGETHER
                    or len(self.measured.children(parent)) > 1
                    or not is_revolute(model.joints[parent])
                ):
                    break
                ball.append(parent)
            meant = any(self._is_meant(joint) or "ball" in str(model.names[joint]).lower() for joint in ball)
            if meant and sum(map(self._is_level, ball)) > 1:
                balls += ball
        return balls

    def _candidates(self, rollers: dict[int, list[int]]) -> list[int]:
        some = {roller for joints in rollers.values() for roller in joints}
        joints = (j for j in range(self.measured.root + 1, self.measured.model.njoints) if j not in some)
        return [
            joint
            for joint in joints
            if (joint in rollers and (self.asked is None or self._is_meant(joint)))
            or (self._is_meant(joint) and self.measured.why_not_rolling(joint) is None)
        ]

    def _between(self, joint: int) -> list[int]:
        """The joints between a wheel and the base but its pivot, hitches and the platform's own."""
        model, above = self.measured.model, self.measured.above(joint)
        upright = [j for j in above if self.measured.is_upright(j)]
        pivots = {j for j in upright if is_named(str(model.names[j]), HITCHES)}
        if upright and not any(is_revolute(model.joints[j]) for j in above[above.index(upright[-1]) + 1 :]):
            pivots.add(upright[-1])  # below it springs at most
        return [j for j in above if j not in pivots and str(model.names[j]) not in self.own]

    def _lowest(self, joint: int) -> float:
        return float(self.measured.placements[joint].translation[2]) - self._radius(joint)

    def _radius(self, joint: int) -> float:
        """m; a usual one where nothing tells it, so that the joints' heights are compared."""
        radius = self.measured.radius(joint)
        return _USUAL if math.isnan(radius) else radius

    def _ground(self, joints: list[int]) -> float:
        """The height, m, that most of the wheels touch; NaN without wheels."""
        heights = [self._lowest(joint) for joint in joints]
        return float(np.median(heights)) if heights else math.nan

    def _is_near(self, joint: int, ground: float, share: float) -> bool:
        return self._lowest(joint) - ground <= share * self._radius(joint)

    def _hangs(self, joint: int, ground: float) -> bool:
        """Whether a wheel below joints that are no pivots is the base's: asked for, or on its ground."""
        return self.asked is not None or abs(self._lowest(joint) - ground) <= _SPRUNG * self._radius(joint)

    def _suspension(self, wheels: list[int], parts: Collection[int]) -> set[int]:
        """The joints that carry nothing that moves but wheels."""
        held: set[int] = set()
        for wheel in wheels:
            between = self._between(wheel)
            pivots = {joint for joint in self.measured.above(wheel) if joint not in between}
            if all(self._carries_only(joint, {*parts, *between, *pivots, *held}) for joint in between):
                held |= set(between)
        return held

    def _idle(self, wheels: list[int]) -> set[int]:
        """What is called a wheel beside real ones, and turns without end about an upright axis, bare."""
        return {
            joint
            for joint in (self.measured.children(self.measured.root) if wheels else ())
            if self._is_meant(joint)
            and not self.measured.children(joint)
            and self.measured.is_upright(joint)
            and self.measured.is_endless(joint)
        }

    def _carries_only(self, joint: int, parts: Collection[int]) -> bool:
        pending = [*self.measured.children(joint)]
        while pending:
            below = pending.pop()
            if below not in parts and not self._leads_to(below, parts):
                return False
            pending += self.measured.children(below)
        return True

    def _leads_to(self, joint: int, parts: Collection[int]) -> bool:
        """Whether one of `parts` is below a joint."""
        return any(child in parts or self._leads_to(child, parts) for child in self.measured.children(joint))

    def _unnamed(self, direct: list[int]) -> list[int]:
        """Joints on the base whose bodies are round about them and on one ground, with what is named so."""
        if self.asked is not None:
            return []
        model, root = self.measured.model, self.measured.root
        unnamed = []
        columns = [joint for joint in self.measured.children(root) if self.measured.is_upright(joint)]
        below = [
            self.measured.children(column)[0]
            for column in columns
            if len(self.measured.children(column)) == 1
        ]
        for joint in (*self.measured.children(root), *below):
            if (
                joint in direct
                or not self.measured.is_endless(joint)
                or self.measured.why_not_rolling(joint) is not None
            ):
                continue
            if str(model.names[joint]) not in self.own and self._is_round(joint):
                unnamed.append(joint)
        if not unnamed or len(unnamed) + len(direct) < 2:
            return []
        ground = self._ground(direct) if direct else min(self._lowest(joint) for joint in unnamed)
        radius = max(self._radius(joint) for joint in (direct or unnamed))
        return [
            joint
            for joint in unnamed
            if abs(self._lowest(joint) - ground) <= _ON_GROUND * radius
            and (direct or abs(self._radius(joint) - radius) <= _ALIKE * radius)
        ]

    def _is_round(self, joint: int) -> bool:
        return any(tyre.is_round for tyre in self.measured.tyres(joint))

    def _rest(self, joint: int) -> float:
        lower, upper = ends_of(self.measured.model, joint)
        return min(max(0.0, lower), upper)
