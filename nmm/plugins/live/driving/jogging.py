"""A robot that is moved by what somebody holds, hand or base: only while messages say so."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.kernels.rotations import left_jacobian_inverse3, log3
from nmm.control.controller import Controller
from nmm.control.limits.limits import Limits
from nmm.control.resolvers import CallableResolver
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import CENTER_OF_MASS
from nmm.plugins.live.driving.base_axes import ANGULAR, LINEAR, base_directions, base_inputs, full_speeds
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.messages import Jog
from nmm.plugins.live.driving.planning import NOTHING, STILL, later
from nmm.plugins.live.driving.setups import Choice, led_by

#: A message holds for so long, s; of one page, those nearer to each other than this are dropped, unless they
#: stop.
VALID, SOONEST = 0.25, 0.005
#: A hand goes through at most this share of the robot's reach in 1 s.
SHARE = 0.25
#: How much slower or faster than at first a page may choose; not faster than the robot's own limits.
SLOWER, FASTER = 20.0, 8.0
GROUP = "Jog speeds"
#: The axes of a base, of the six of a message.
BASE_AXES = (0, 1, 5)
AXES = ("x", "y", "z", "rx", "ry", "rz")


class Heard(NamedTuple):
    """A message, of which page it is, and when it came, s."""

    jog: Jog
    page: object
    since: float


class Moved(NamedTuple):
    """What moves: the base, or the frame of a task."""

    part: str
    task: int


class Jogging:
    """Base or hand of a robot in its own axes, while somebody holds a dead man's switch.

    A page says again and again how it moves. Where it says nothing for `VALID`, says that nothing moves, or
    is gone, the inputs go to 0 as fast as limits and distances allow, and the robot stands until something is
    aimed at.

    Parameters
    ----------
    speeds : at full axes, by name: "linear", m/s, and "angular", rad/s, of the hand, and the inputs of the
        platform
    clock : seconds that pass

    Attributes
    ----------
    on : whether it leads the robot, which moves, or stands where it was let go of
    paused : whether nothing is to move
    choices : the speeds, for the page

    Raises
    ------
    InputError : a speed of something else, not above 0, or above the robot's own limit
    """

    def __init__(
        self,
        driven: Driven,
        speeds: Mapping[str, float] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.on = self.paused = False
        self._driven, self._clock = driven, clock
        self._held: Heard | None = None
        self._moved: Moved | None = None
        self._inputs = np.zeros(driven.robot.n_u)
        self._standing: Controller | None = None
        self._making: Future[Controller] | None = later(lambda: self.standing(driven.reacting))
        self._brought: tuple[int, ...] = ()
        self.choices = _choices(driven, speeds or {})

    # in the thread of the pages

    def hear(self, jog: Jog, page: object) -> None:
        """Take a page's message, unless another page moves the robot; `InputError` for what does not move."""
        targets, now = self._driven.targets, self._clock()
        if jog.part == "base":
            expect(self._driven.robot.platform.p, "base", "a platform that moves", "none")
        else:
            expect(jog.task < len(targets), "task", f"a number below {len(targets)}", jog.task)
            if targets[jog.task].frame is None:
                raise InputError("puts no frame in the world", where=f"task {jog.task}")
        held = self._held
        age = np.inf if held is None or not held.jog.moves else now - held.since
        others = held is not None and held.page is not page
        if age > (VALID if others else SOONEST if jog.moves else -1.0):
            self._held = Heard(jog, page, now)

    def gone(self, page: object) -> None:
        """A page has gone; what it held is let go of."""
        held = self._held
        if held is not None and held.page is page:
            self._held = None

    # in the thread of the loop

    @property
    def wanted(self) -> Jog | None:
        """What holds now; None where nothing moves."""
        held = self._held
        if self.paused or held is None or not held.jog.moves or self._clock() - held.since > VALID:
            return None
        return held.jog

    def choose(self, key: str, value: object) -> None:
        """Another speed; `InputError` for another kind, or one out of range."""
        known = {choice.key: choice for choice in self.choices}
        expect_known("choice", key[:80], known, "drive")
        chosen = known[key].checked(value)
        self.choices = [replace(one, value=chosen) if one.key == key else one for one in self.choices]

    def leave(self) -> None:
        """Let targets lead the robot again."""
        if self.on:
            self._rest()
            self.on = False
            self._driven.lead(None)

    def standing(self, reacting: Controller) -> Controller:
        """Gives the base's inputs, and 0 of the arm's, within the limits of a controller, or the robot's own,
        and its distances; made apart, as it may take longer than a step."""
        if reacting.limits is None:
            reacting = reacting.with_arguments(limits=Limits())
        made = led_by(reacting, NOTHING, CallableResolver(lambda problem: self._inputs))
        with suppress(Exception):  # the loop meets it again, and reports it
            made.step(0.0, self._driven.q.copy(), self._driven.setup.dt)  # the first call compiles
        made.reset()
        return made

    def renew(self, standing: Controller) -> None:
        """The robot has another controller: what is led goes on, by that one's limits and distances."""
        self._standing, self._making = standing, None
        if self.on and self.part != "hand":
            self._driven.lead(standing)

    def attend(self, jog: Jog | None) -> None:
        """Begin to move as is `wanted`, or go on to stand: once a picture, between which `prepare` does the
        rest."""
        driven = self._driven
        if self._making is not None and self._making.done():
            making, self._making = self._making, None
            self._standing = making.result()
        if self._standing is None:
            return
        moved = None if jog is None else Moved(jog.part, jog.task if jog.part == "hand" else 0)
        if moved is not None and moved != self._moved:
            self._rest()
            self.on, self._moved = True, moved
            self._brought = (moved.task,) if moved.part == "hand" else tuple(range(len(driven.targets)))
            driven.lead(None if moved.part == "hand" else self._standing)
        self.prepare()
        if self.on and self.part != "hand" and self._brought:  # a hand takes its target along itself
            driven.targets_here(self._brought)
            if self._moved is None and np.abs(driven.u).max(initial=0.0) < STILL:
                self._brought = ()

    def prepare(self) -> None:
        """Say what moves in the next step, or stop; before each step."""
        jog = self.wanted
        if self._moved is None:
            return
        if jog is None or jog.part != self._moved.part:
            hand = self.part == "hand"
            self._rest()
            if hand:
                self._driven.lead(self._standing)
        elif jog.part == "hand":
            self._move_hand(jog, self._moved.task)
        else:
            platform = self._driven.robot.platform
            axes, qp = np.array(jog.axes)[list(BASE_AXES)], self._driven.seen[: platform.n_p]
            self._inputs[: platform.p] = base_inputs(platform, qp, axes, self._speeds)

    @property
    def part(self) -> str:
        """What moves now, "hand" or "base", or ""."""
        return "" if self._moved is None else self._moved.part

    def words(self) -> str:
        """What a page says of it; "" where it does not lead the robot."""
        if self.part:
            return f"the {self.part} moves while you hold on"
        if self.on:
            return "it stands where it was let go of: hold on, or aim at something"
        return "what you hold is heard soon" if self._making is not None and self.wanted is not None else ""

    def for_page(self) -> dict[str, Any]:
        """What can be moved: tasks whose frame is a hand, with their axes, and the base's axes."""
        hands = []
        for number, target in enumerate(self._driven.targets):
            if target.frame is not None:
                turns = AXES[3:] if target.rotation else ()
                hands.append({"task": number, "name": target.title, "axes": [*target.axes, *turns]})
        return {"hands": hands, "base": self.base_axes}

    @property
    def base_axes(self) -> list[str]:
        """The axes along and about which the base can be moved, as its wheels are steered now."""
        platform = self._driven.robot.platform
        directions = base_directions(platform, self._driven.q[: platform.n_p], self._speeds)
        moved = np.abs(directions).max(axis=0, initial=0.0)
        return [AXES[axis] for axis, most in zip(BASE_AXES, moved, strict=True) if most > 0.0]

    @property
    def _speeds(self) -> Array:
        return np.array([self._full(name) for name in self._driven.robot.platform.inputs])

    def _full(self, name: str) -> float:
        return float(next(choice.value for choice in self.choices if choice.key == f"jog.{name}"))

    def _rest(self) -> None:
        """Nothing is to move any more; a target that was moved with a hand stays where it is."""
        if self._moved is not None and self._moved.part == "hand":
            signal = self._driven.targets[self._moved.task].signal
            signal.set(signal.value)
        self._moved = None
        self._inputs[:] = 0.0

    def _move_hand(self, jog: Jog, task: int) -> None:
        """The target is where the frame is now, and moves as it is to move: no error is left over."""
        driven, target = self._driven, self._driven.targets[task]
        here = Configuration(driven.robot, driven.seen)
        if target.frame == CENTER_OF_MASS:
            place, R = here.center_of_mass()[0], None
        else:
            placed = here.placement(str(target.frame))
            place, R = placed.translation, placed.rotation
        turned = _base_rotation(driven) if jog.frame == "base" or R is None else R
        shares = np.array(jog.axes).reshape(2, 3)
        shares /= np.maximum(1.0, np.linalg.norm(shares, axis=1, keepdims=True))
        if jog.frame != "world":
            shares = shares @ turned.T
        value = target.signal.value
        rate = np.zeros_like(value)
        for axis, row in target.axes.items():
            i = AXES.index(axis)
            value[row], rate[row] = place[i], self._full("linear") * shares[0, i]
        if target.rotation and R is not None:
            phi, J = np.zeros(3), np.zeros((3, 3))
            log3(np.ascontiguousarray(R), phi)
            left_jacobian_inverse3(phi, J)
            rows = list(target.rotation)
            value[rows], rate[rows] = phi, J @ (self._full("angular") * shares[1])
        target.signal.set(value, rate, driven.elapsed)


def _base_rotation(driven: Driven) -> Array:
    """The platform's axes in the world, (3, 3)."""
    theta = driven.seen[2] if driven.robot.platform.n_p else 0.0
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _choices(driven: Driven, given: Mapping[str, float]) -> list[Choice]:
    """A choice for each speed that there is, at first `given` or, of the hand, at most `LINEAR` and
    `ANGULAR`."""
    robot = driven.robot
    firsts: dict[str, tuple[str, float, str, float]] = {}
    hands = [target for target in driven.targets if target.frame is not None]
    if any(target.axes for target in hands):
        firsts["linear"] = ("hand", min(LINEAR, SHARE * float(robot.reach)), "m/s", np.inf)
    if any(target.rotation for target in hands):
        firsts["angular"] = ("hand's turn", ANGULAR, "rad/s", np.inf)
    platform = robot.platform
    rows = zip(platform.inputs, full_speeds(robot, driven.q), platform.input_units, strict=True)
    for (name, first, unit), limit in zip(rows, robot.u_limits[: platform.p], strict=True):
        firsts[name] = (name, float(first), unit, float(limit))
    for name in given:
        expect_known("speed", name, firsts, "jog speeds")
    choices = []
    for name, (text, first, unit, limit) in firsts.items():
        value = positive(given.get(name, first), f"jog speed {name}")
        expect(value <= limit, f"jog speed {name}", f"at most the robot's limit, {limit:g} {unit}", value)
        least, most = min(first / SLOWER, value), max(min(first * FASTER, limit), value)
        choices.append(Choice(f"jog.{name}", text, GROUP, value, (), least, most, unit))
    return choices
