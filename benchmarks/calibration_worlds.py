"""Robots in MuJoCo whose radii, tracks, lengths and steering are other than those of nmm's robots, drawn at
random, with the motions that they are driven by.

A mecanum wheel is a ball on a ball joint, which is driven about one axis and free about the other, as its
rollers are.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from calibration_mjcf import STEP, World, body, box, driven, foot, hinge, mjcf, rolling, tyre, wheel

import nmm

Array = np.ndarray
#: Of tyres that give: a load's mass over their stiffness, s, by which it follows them later (velocities
#: beside rates of wheels, over five drives without noise: 3.8 to 4.4 ms); the mean speed of drives, m/s.
CREEP, CRUISE = 0.0040, 0.25
#: Steps of MuJoCo in one of a drive, where hitches turn.
SUBSTEPS = 8
CORNERS = tuple(f"{end}_{side}_wheel_joint" for end in ("front", "rear") for side in ("left", "right"))


@functools.cache
def robot_of(name: str, platform: str | None = None) -> nmm.Robot:
    return nmm.load(name, platform=platform) if platform else nmm.load(name)


def near(rng: np.random.Generator, value: float, share: float = 0.05) -> float:
    """A number near another, up to a share of it off."""
    return float(value * (1.0 + share * rng.uniform(-1.0, 1.0)))


def waves(t: Array, rng: np.random.Generator, mean: float, size: float, fastest: float = 0.25) -> Array:
    """Three sines (N,) of periods from 1 / fastest to 16 s, with their accelerations in bounds."""
    made = np.full(len(t), mean)
    for _ in range(3):
        made += size / 1.7 * np.sin(2.0 * math.pi * (rng.uniform(0.06, fastest) * t + rng.uniform()))
    return made


def differential(rng: np.random.Generator, unlike: float = 0.05, track_off: float = 0.1) -> World:
    """Two driven wheels and a foot in front; radii and track off by these shares at most."""
    robot, names = robot_of("differential_base"), ("left_wheel_joint", "right_wheel_joint")
    radii, track = [near(rng, 0.1, unlike), near(rng, 0.1, unlike)], near(rng, 0.5, track_off)
    sides = zip(names, (track / 2, -track / 2), radii, strict=True)
    parts = box(0.08, 20.0), foot(0.25), *(wheel(name, 0.0, y, r) for name, y, r in sides)
    truth = {f"radius.{name}": radius for name, radius in zip(names, radii, strict=True)} | {"track": track}
    xml = mjcf("".join(parts), driven(*names), names, slipping=names)
    return World(robot, truth, xml, [*names], both_ways, wheel_speeds, wheel_speeds, picked(*names))


def picked(*names: str) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
    """Readings that are what sensors of these names say."""
    return lambda seen: {name: seen[name] for name in names}


def both_ways(t: Array, rng: np.random.Generator) -> Array:
    """v and omega: mostly ahead, turning both ways."""
    return np.stack([waves(t, rng, CRUISE, 0.3), waves(t, rng, 0.0, 0.7)], axis=1)


def wheel_speeds(u: Array) -> Array:
    return (u[:, :1] + u[:, 1:] * [[-0.25, 0.25]]) / 0.1


def skid_steer(rng: np.random.Generator, grip: float = 8.0, stiff: float = 0.0015) -> World:
    """Four wheels, those of a side geared together, that turn by creeping sideways: tyres which give in
    proportion to the load. Wheels at (±x, ±y) turn about centres at y + x² / y then: the moments of their
    forces add up to none. In bends the load pushes outwards: they turn about a point further ahead. It turns
    as late as it goes: its radius of gyration is the way to a wheel."""
    robot = robot_of("omni_base", "skid_steer")
    names = [*CORNERS]
    radii = {"left": near(rng, 0.1), "right": near(rng, 0.1)}
    x, y = near(rng, 0.2, 0.1), near(rng, 0.25, 0.1)
    parts, gears = [box(0.0, 20.0, math.sqrt(12.0 * (x * x + y * y) - 0.4**2))], []
    for name in names:
        end, side = name.split("_")[:2]
        parts.append(wheel(name, x if end == "front" else -x, y if side == "left" else -y, radii[side]))
    for side in radii:
        geared = f'joint1="front_{side}_wheel_joint" joint2="rear_{side}_wheel_joint"'
        gears.append(f'<joint {geared} solref="{2 * STEP} 1"/>')
    far = y + x * x / y
    truth = {f"radius.{name}": radii[name.split("_")[1]] for name in names}
    truth |= {"left": far, "right": -far, "ahead": CRUISE * CREEP, "delay": CREEP}
    more = f"<equality>{''.join(gears)}</equality>"
    counted = [*names, *(f"{name}_slip" for name in names)]
    xml = mjcf("".join(parts), driven(*names[:2]), counted, more, names, grip, stiff)
    return World(
        robot,
        truth,
        xml,
        names,
        both_ways,
        wheel_speeds,
        lambda u: np.tile(wheel_speeds(u), 2),
        of_tyres(names),
    )


def of_tyres(names: Sequence[str]) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
    """Readings of wheels whose tyres slip by what they are told alone: those of a robot that turns by
    creeping would turn on their hubs by what the ground pushes, too."""

    def readings(seen: Mapping[str, Array]) -> dict[str, Array]:
        turned = {name: seen[name] + seen[f"{name}_slip"] for name in names}
        return {name: turned[name] - seen["slips"][:, i] for i, name in enumerate(names)}

    return readings


def car(rng: np.random.Generator) -> World:
    """Rear wheels driven through a differential, front wheels steered by a linkage of Ackermann's angles; the
    steering encoder has an offset and a gear that are wrong."""
    robot = robot_of("car_base")
    names = [*CORNERS]
    radii = {name: near(rng, 0.12) for name in names}
    base, track = near(rng, 0.7, 0.1), near(rng, 0.56, 0.1)
    offset, ratio = float(rng.uniform(-0.04, 0.04)), near(rng, 1.0)
    pivot, out = 0.2368, 0.28
    parts = [box(0.5 * base, 30.0, base)]
    for name in names[2:]:
        parts.append(wheel(name, 0.0, 0.5 * track if "left" in name else -0.5 * track, radii[name]))
    for name in names[:2]:
        sign, r = (1.0 if "left" in name else -1.0), radii[name]
        rolls = body(name, (0.0, sign * (out - pivot), 0.0), *rolling(name, r))
        knuckle = '<geom type="sphere" class="load" size="0.02" mass="0.5"/>'
        turns = hinge(f"{name}_steer", "0 0 1")
        parts.append(body(f"{name}_knuckle", (base, sign * pivot, r), turns, knuckle, rolls))
    steered = [f"{name}_steer" for name in names[:2]]
    shares = "".join(f'<joint joint="{name}" coef="0.5"/>' for name in names[2:])
    tendon = f'<tendon><fixed name="axle">{shares}</fixed></tendon>'
    servos = "".join(f'<position joint="{n}" kp="200" kv="12"/>' for n in steered)
    actuators = f'<velocity tendon="axle" kv="30"/>{servos}'

    def commands(u: Array) -> Array:
        cot = 1.0 / np.tan(np.where(np.abs(u[:, 1]) < 1e-9, 1e-9, u[:, 1]))
        angles = [np.arctan(1.0 / (cot - side * pivot / base)) for side in (1, -1)]
        return np.stack([u[:, 0] / 0.12, *angles], axis=1)

    def readings(seen: Mapping[str, Array]) -> dict[str, Array]:
        left, right = (np.tan(seen[name]) for name in steered)
        delta = half_before(_middle(left, right, base, pivot))
        return {name: seen[name] for name in names} | {"steering": (delta - offset) / ratio}

    truth = {f"radius.{name}": radius for name, radius in radii.items()}
    truth |= {"wheelbase": base, "track": track, "offset.steering": offset, "ratio.steering": ratio}
    xml = mjcf("".join(parts), actuators, [*names, *steered], tendon, names)
    return World(
        robot, truth, xml, names, steering, commands, lambda u: np.tile(u[:, :1] / 0.12, 4), readings
    )


def half_before(values: Array) -> Array:
    """Angles (N,) half a step before: MuJoCo's speeds in a step are by the angles where it begins."""
    return np.concatenate([values[:1], 0.5 * (values[1:] + values[:-1])])


def _middle(left: Array, right: Array, base: float, pivot: float) -> Array:
    """The steering angle between tangents of the wheels' angles: the mean of what each of them says."""
    share = pivot / base
    return np.arctan(0.5 * (left / (1.0 + share * left) + right / (1.0 - share * right)))


def steering(t: Array, rng: np.random.Generator) -> Array:
    """v and the steering angle."""
    return np.stack([waves(t, rng, 0.35, 0.3), np.clip(waves(t, rng, 0.0, 0.35), -0.55, 0.55)], axis=1)


def mecanum(rng: np.random.Generator) -> World:
    """Balls that are driven about the one horizontal axis and free about the other."""
    robot = robot_of("omni_base")
    names = [*CORNERS]
    radii, x, y = {name: near(rng, 0.1) for name in names}, near(rng, 0.25, 0.1), near(rng, 0.25, 0.1)
    parts, actuators, axes = [box(0.0, 20.0)], "", {}
    for name in names:
        ahead, left = (1.0 if "front" in name else -1.0), (1.0 if "left" in name else -1.0)
        inertia = f'<joint name="{name}" type="ball" armature="0.01"/>'
        parts.append(body(name, (ahead * x, left * y, radii[name]), inertia, tyre(radii[name])))
        grips = np.array([1.0, -ahead * left]) / math.sqrt(2.0)  # along the roller's axis, in the ground
        axes[name] = np.array([-grips[1], grips[0], 0.0])  # turned about this, it goes along grips
        gear = " ".join(map(repr, axes[name].tolist()))
        actuators += f'<velocity name="{name}" jointinparent="{name}" gear="{gear} 0 0 0" kv="10"/>'
    sensors = "".join(f'<actuatorvel name="{name}" actuator="{name}"/>' for name in names)
    xml = mjcf("".join(parts), actuators, ()).replace("<sensor>", f"<sensor>{sensors}")
    half = 0.5

    def commands(u: Array) -> Array:
        rows = []
        for name in names:
            ahead, left = (1.0 if "front" in name else -1.0), (1.0 if "left" in name else -1.0)
            rows.append((u[:, 0] - ahead * left * u[:, 1] - left * half * u[:, 2]) / 0.1 / math.sqrt(2.0))
        return np.stack(rows, axis=1)

    def readings(seen: Mapping[str, Array]) -> dict[str, Array]:
        turned = {name: math.sqrt(2.0) * STEP * np.cumsum(seen[name]) for name in names}
        return {name: turned[name] - seen["slips"][:, i] for i, name in enumerate(names)}

    truth = {f"radius.{name}": radius for name, radius in radii.items()} | {"half_length_plus_width": x + y}
    return World(
        robot, truth, xml, names, all_ways, commands, lambda u: math.sqrt(2.0) * commands(u), readings
    )


def all_ways(t: Array, rng: np.random.Generator) -> Array:
    return np.stack([waves(t, rng, 0.1, 0.3), waves(t, rng, 0.0, 0.25), waves(t, rng, 0.0, 0.6)], axis=1)


def tractor(rng: np.random.Generator) -> World:
    """A differential drive with two trailers whose hitches turn freely, and are read. In MuJoCo's step they
    turn by their angles where it begins: lengths seem to be off by half of its way, which is short here."""
    robot, names = robot_of("trailer_base"), ["left_wheel_joint", "right_wheel_joint"]
    radii, track = [near(rng, 0.1), near(rng, 0.1)], near(rng, 0.44, 0.1)
    H1, L1, H2, L2 = near(rng, 0.25, 0.1), near(rng, 0.7), near(rng, 0.25, 0.1), near(rng, 0.7)
    behind = [near(rng, 0.1), near(rng, 0.1)]
    rolling_wheels = ["left_wheel1_joint", "right_wheel1_joint"]
    last = [
        body(f"{side}2", (-L2, y, 0.1), hinge(f"{side}2", "0 1 0"), tyre(0.1))
        for side, y in (("left", 0.22), ("right", -0.22))
    ]
    trailer2 = body("trailer2", (-L1 - H2, 0.0, 0.0), hinge("hitch2", "0 0 1"), box(-L2, 8.0, 0.3), *last)
    own = [wheel(n, -L1, y, r) for n, y, r in zip(rolling_wheels, (0.22, -0.22), behind, strict=True)]
    load = box(-L1, 8.0, 0.3)
    trailer1 = body("trailer1", (-H1, 0.0, 0.0), hinge("hitch1", "0 0 1"), load, *own, trailer2)
    sides = zip(names, (track / 2, -track / 2), radii, strict=True)
    parts = box(0.05, 20.0), *(wheel(name, 0.0, y, r) for name, y, r in sides), trailer1
    truth = {f"radius.{name}": radius for name, radius in zip(names, radii, strict=True)}
    truth |= {"track": track, "H1": H1, "L1": L1, "H2": H2, "L2": L2}
    counted = [*names, *rolling_wheels, "hitch1", "hitch2"]

    def ahead(t: Array, rng: np.random.Generator) -> Array:
        return np.stack([np.maximum(waves(t, rng, 0.4, 0.2), 0.1), waves(t, rng, 0.0, 0.35)], axis=1)

    def commands(u: Array) -> Array:
        return (u[:, :1] + u[:, 1:] * [[-0.22, 0.22]]) / 0.1

    xml = mjcf("".join(parts), driven(*names), counted, slipping=[*names, *rolling_wheels], substeps=SUBSTEPS)
    return World(
        robot,
        truth,
        xml,
        [*names, *rolling_wheels],
        ahead,
        commands,
        lambda u: np.tile(commands(u), 2),
        picked(*counted),
        SUBSTEPS,
    )


PLATFORMS: dict[str, Callable[[np.random.Generator], World]] = {
    "differential": differential,
    "skid-steer": skid_steer,
    "car": car,
    "mecanum": mecanum,
    "tractor, two trailers": tractor,
}
