"""The lengths that say how a platform moves by what its wheels turn, and robots with others in their place.

Where wheels touch the ground (`Wheel.rolls_at`) and joints that steer or hitch go with them; shapes, and the
wheels' centres, stay where the file has them: a track that is felt is not the one that is drawn."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from nmm.model.platforms import (
    Car,
    CasterWheel,
    DifferentialDrive,
    FixedWheel,
    FrontDriveCar,
    Hitch,
    Mecanum,
    Platform,
    SkidSteer,
    SteeredWheel,
    Tractor,
    Trailer,
    WheeledPlatform,
)
from nmm.model.platforms.wheel_layout import MAIN_BODY, NEAR, PARALLEL
from nmm.model.platforms.wheeled.descriptions import WheelDescription
from nmm.model.robots.number_change import Length, RobotChange, hitched
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.model.robots.wheel_rates import wheel_rates

#: A platform's length and that of its wheels are one where they differ by no more, m.
_SAME = 1e-9


def lengths_of(robot: Robot) -> dict[str, Length]:
    """The lengths of a robot's platform, by name, in a fixed order."""
    if robot.platform.n_p < 3:
        return {}
    return dict(_lengths(robot, robot.platform, _counted(robot)))


def main_wheels(robot: Robot) -> list[Wheel]:
    """The wheels on the main body whose turning says how it moves, without those that steer."""
    return [wheel for wheel in _counted(robot) if wheel.carrier == MAIN_BODY and not wheel.swivel]


def _counted(robot: Robot) -> list[Wheel]:
    names, _ = wheel_rates(robot)
    return [wheel for wheel in robot.wheels if wheel.joint in names]


def _lengths(robot: Robot, platform: Platform, counted: list[Wheel]) -> Iterator[tuple[str, Length]]:
    main = [wheel for wheel in counted if wheel.carrier == MAIN_BODY and not wheel.swivel]
    if isinstance(platform, SkidSteer):
        for name in ("left", "right", "ahead"):
            yield name, Length(getattr(platform, name), "centre", _centre(name, main), -math.inf)
    elif isinstance(platform, Mecanum):
        half = 0.5 * (platform.length + platform.width)
        yield "half_length_plus_width", Length(half, "distance", _rectangle(main))
    elif isinstance(platform, WheeledPlatform):
        yield from _of_described(robot, platform, main)
    elif isinstance(platform, Car | FrontDriveCar):
        yield "wheelbase", Length(platform.wheelbase, "wheelbase", _wheelbase(counted))
        yield from _track(main)
    elif isinstance(platform, DifferentialDrive):
        own = _apart(_forward(main))
        track = platform.track if not own or abs(own - platform.track) <= _SAME else own
        yield "track", Length(track, "track", _sides(_forward(main), track))
    elif _forward(main) and _apart(_forward(main)):
        yield from _track(main)
    elif main:
        far = _mean(math.hypot(*wheel.rolls_at[:2]) for wheel in main)
        if far > NEAR:
            yield "wheel_distance", Length(far, "distance", _spread(main, far))
    if isinstance(platform, Tractor):
        yield from _of_trailers(platform)


def _mean(values: Iterable[float]) -> float:
    """Exact, so that the mean of equal numbers is theirs."""
    return float(statistics.mean([*map(float, values)]))


def _forward(main: Sequence[Wheel]) -> list[Wheel]:
    """The plain wheels that roll ahead or back: of these only y matters."""
    return [wheel for wheel in main if wheel.is_fixed and abs(wheel.axis[0]) <= PARALLEL]


def _apart(wheels: Sequence[Wheel]) -> float:
    """From the middle of those at the right to that of those at the left, m; 0 where one side has none."""
    sides = [
        [float(wheel.rolls_at[1]) for wheel in wheels if side * wheel.rolls_at[1] > NEAR] for side in (1, -1)
    ]
    return _mean(sides[0]) - _mean(sides[1]) if all(sides) else 0.0


def _track(main: list[Wheel]) -> Iterator[tuple[str, Length]]:
    forward = _forward(main)
    if track := _apart(forward):
        yield "track", Length(track, "track", _sides(forward, track))


def _sides(wheels: list[Wheel], own: float) -> Callable[[RobotChange, float], None]:
    def change(draft: RobotChange, value: float) -> None:
        platform = draft.platform
        if isinstance(platform, DifferentialDrive):
            platform.track *= value / own
        draft.scale(wheels, 1.0, value / own)

    return change


def _spread(wheels: list[Wheel], own: float) -> Callable[[RobotChange, float], None]:
    return lambda draft, value: draft.scale(wheels, value / own, value / own)


def _rectangle(main: list[Wheel]) -> Callable[[RobotChange, float], None]:
    def change(draft: RobotChange, value: float) -> None:
        platform = draft.platform
        assert isinstance(platform, Mecanum)  # no other has this length
        share = value / (0.5 * (platform.length + platform.width))
        platform.length, platform.width = share * platform.length, share * platform.width
        draft.scale(main, share, share)

    return change


def _centre(name: str, main: list[Wheel]) -> Callable[[RobotChange, float], None]:
    def change(draft: RobotChange, value: float) -> None:
        setattr(draft.platform, name, value)
        for wheel in main:
            draft.roll_at(wheel.joint, *draft.platform.rolls_at(*map(float, wheel.center[:2])))

    return change


def _wheelbase(counted: list[Wheel]) -> Callable[[RobotChange, float], None]:
    def change(draft: RobotChange, value: float) -> None:
        platform = draft.platform
        assert isinstance(platform, Car | FrontDriveCar)  # likewise
        by = value - platform.wheelbase
        platform.wheelbase = value
        draft.move(platform.steering, by)
        along = np.array([by, 0.0, 0.0])
        for wheel in counted:
            if wheel.swivel:
                turned = {key: getattr(wheel, key) + along for key in ("center", "pivot", "rolls_at")}
                draft.wheels[wheel.joint] = replace(draft.wheels[wheel.joint], **turned)
        for swivel in {wheel.swivel for wheel in counted if wheel.swivel}:
            draft.move(swivel, by)

    return change


def _of_trailers(platform: Tractor) -> Iterator[tuple[str, Length]]:
    names = iter(platform.parameter_names)
    for number in range(len(platform.trailers)):
        for key in ("hitch", "length"):
            value = getattr(platform.trailers[number], key)
            least = 0.0 if key == "length" else -math.inf
            yield next(names), Length(value, "hitch", _trailer(number, key), least)


def _trailer(number: int, key: str) -> Callable[[RobotChange, float], None]:
    def change(draft: RobotChange, value: float) -> None:
        platform = draft.platform
        assert isinstance(platform, Tractor)  # likewise
        trailers = [*platform.trailers]
        by = value - getattr(trailers[number], key)
        trailers[number] = replace(trailers[number], **{key: value})  # type: ignore[arg-type]  # of the name
        platform.trailers = tuple(trailers)
        _hitch_on(draft, trailers, number, key, by)

    return change


def _hitch_on(draft: RobotChange, trailers: Sequence[Trailer], number: int, key: str, by: float) -> None:
    """A hitch goes back by so much, m, or a trailer's wheels and the hitch behind them."""
    if key == "hitch":
        draft.move(trailers[number].joint, -by)
        return
    _move_wheels(draft, trailers[number].joint, -by)
    if number + 1 < len(trailers):
        draft.move(trailers[number + 1].joint, -by)


def _move_wheels(draft: RobotChange, carrier: str, by: float) -> None:
    for wheel in [*draft.wheels.values()]:
        if wheel.carrier == carrier and not wheel.swivel:
            draft.roll_at(wheel.joint, float(wheel.rolls_at[0]) + by, float(wheel.rolls_at[1]))


def _of_described(robot: Robot, platform: WheeledPlatform, main: list[Wheel]) -> Iterator[tuple[str, Length]]:
    """Of a platform described by its wheels: track and wheelbase where a fixed axle lies across it, else how
    far its wheels are from the reference point; then its hitches."""
    own = [w for w in platform.wheels if w.body == MAIN_BODY and not isinstance(w, CasterWheel)]
    fixed = [wheel for wheel in own if isinstance(wheel, FixedWheel)]
    steered = [wheel for wheel in own if isinstance(wheel, SteeredWheel)]
    if fixed and all(abs(math.sin(wheel.heading)) <= PARALLEL for wheel in fixed):
        forward = _forward(main)
        if track := _apart(forward):
            yield "track", Length(track, "track", _described(fixed, forward, track, (0.0, 1.0)))
        base = _mean(abs(wheel.x) for wheel in steered) if steered else 0.0
        if base > NEAR:
            yield "wheelbase", Length(base, "wheelbase", _described(steered, [], base, (1.0, 0.0)))
    elif own:
        far = _mean(math.hypot(wheel.x, wheel.y) for wheel in own)
        if far > NEAR:
            yield "wheel_distance", Length(far, "distance", _described(own, main, far, (1.0, 1.0)))
    yield from _of_hitches(platform)


def _described(
    parts: Sequence[WheelDescription], wheels: list[Wheel], own: float, along: tuple[float, float]
) -> Callable[[RobotChange, float], None]:
    """Descriptions, pivots and wheels go so many times farther from the reference point, in x, y or both."""

    def change(draft: RobotChange, value: float) -> None:
        share = value / own - 1.0
        x, y = (share * axis for axis in along)
        for part in parts:
            at = {"x": part.x + x * part.x, "y": part.y + y * part.y}
            draft.parts[part.name] = replace(draft.parts[part.name], **at)
        pivots = {part.joint: part for part in parts if isinstance(part, SteeredWheel)}
        for joint, pivot in pivots.items():
            draft.move(joint, x * pivot.x, y * pivot.y)
        draft.scale(wheels, 1.0 + x, 1.0 + y)

    return change


def _of_hitches(platform: WheeledPlatform) -> Iterator[tuple[str, Length]]:
    def axle(body: str) -> float | None:
        """Where the wheels are on a body, x in m; None without."""
        own = [w.x for w in platform.wheels if w.body == body and not isinstance(w, CasterWheel)]
        return _mean(own) if own else None

    for hitch in platform.hitches:
        back = (axle(hitch.carrier) or 0.0) - hitch.x
        yield f"hitch.{hitch.joint}", Length(back, "hitch", _hitch(hitch.joint, back), -math.inf)
        behind = axle(hitch.joint)
        if behind is not None and behind < 0.0:
            yield f"length.{hitch.joint}", Length(-behind, "hitch", _length(platform, hitch.joint, -behind))


def _hitch(joint: str, own: float) -> Callable[[RobotChange, float], None]:
    return lambda draft, value: _shift(draft, hitched(joint), own - value)


def _length(platform: WheeledPlatform, joint: str, own: float) -> Callable[[RobotChange, float], None]:
    def change(draft: RobotChange, value: float) -> None:
        by = own - value
        for wheel in platform.wheels:
            if wheel.body == joint and not isinstance(wheel, CasterWheel):
                _shift(draft, wheel.name, by)
        for other in platform.hitches:
            if other.carrier == joint:
                _shift(draft, hitched(other.joint), by)
        _move_wheels(draft, joint, by)

    return change


def _shift(draft: RobotChange, name: str, by: float) -> None:
    """A wheel's description or a hitch goes ahead by so much, m, and the joint that it stands for."""
    part = draft.parts[name] = replace(draft.parts[name], x=draft.parts[name].x + by)
    if isinstance(part, Hitch | SteeredWheel):
        draft.move(part.joint, by)
