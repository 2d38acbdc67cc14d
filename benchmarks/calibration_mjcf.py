"""Parts of robots for MuJoCo, as MJCF, and the world around them.

Wheels are spheres on hinges, so that they touch the ground at one point, where their radius says. Contacts
are stiff: a wheel sinks in by some µm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import nmm

Array = np.ndarray
#: A step of a drive, s.
STEP = 0.002
#: Friction, and how stiff friction is beside the contact itself (MuJoCo's impratio).
GRIP, STIFF = 1.0, 100.0


@dataclass
class World:
    """A robot in MuJoCo.

    robot : nmm's, by its file
    truth : its numbers, by name; a `delay` comes on top of the reference's
    xml : MJCF
    wheels : bodies that rough ground pushes, whose turning is counted
    rates : about how fast these turn for a driver's inputs (N, p), (N, w), rad/s
    commands : controls (N, nu) of inputs (N, p) of a driver; those of what slips come after them, or, of
        balls, are rates that are added
    inputs : of a driver, at times (N,), with random numbers
    readings : counters by name, of sensors by name (N, ...)
    substeps : so many steps of MuJoCo are one of a drive
    """

    robot: nmm.Robot
    truth: dict[str, float]
    xml: str
    wheels: list[str]
    inputs: Callable[[Array, np.random.Generator], Array]
    commands: Callable[[Array], Array]
    rates: Callable[[Array], Array]
    readings: Callable[[Mapping[str, Array]], dict[str, Array]]
    substeps: int = 1

    def controls(self, u: Array, slips: Array) -> Array:
        """Of inputs (N, p), with wheels that have slipped by (N, w), rad."""
        told = self.commands(u)
        if "_slip" in self.xml:
            return np.concatenate([told, slips], axis=1)
        return told + np.gradient(slips, STEP, axis=0) / math.sqrt(2.0)


def body(name: str, at: Sequence[float], *parts: str) -> str:
    return f'<body name="{name}" pos="{" ".join(map(repr, map(float, at)))}">{"".join(parts)}</body>'


def hinge(name: str, axis: str) -> str:
    return f'<joint name="{name}" axis="{axis}" armature="0.02"/>'


def tyre(radius: float) -> str:
    return f'<geom type="sphere" class="tyre" size="{radius!r}"/>'


def wheel(name: str, x: float, y: float, radius: float) -> str:
    return body(name, (x, y, radius), *rolling(name, radius))


def rolling(name: str, radius: float) -> tuple[str, str, str]:
    """A hub, whose turning is counted, and a tyre that slips on it as it is told."""
    rim = body(f"{name}_tyre", (0.0, 0.0, 0.0), hinge(f"{name}_slip", "0 1 0"), tyre(radius))
    hub = '<geom type="sphere" class="load" size="0.03" mass="0.3"/>'
    return hinge(name, "0 1 0"), hub, rim


def box(x: float, mass: float, long: float = 0.5) -> str:
    """A chassis's load, which touches nothing."""
    return f'<geom type="box" class="load" size="{long / 2} 0.2 0.05" pos="{x} 0 0.15" mass="{mass}"/>'


def foot(x: float) -> str:
    """What slides without friction, in the place of a caster."""
    return f'<geom type="sphere" size="0.04" pos="{x} 0 0.04" mass="0.1" condim="1"/>'


def mjcf(
    robot: str,
    actuators: str,
    counted: Sequence[str],
    more: str = "",
    slipping: Sequence[str] = (),
    grip: float = GRIP,
    stiff: float = STIFF,
    substeps: int = 1,
) -> str:
    """The world around the parts of a robot's base."""
    actuators += "".join(f'<position joint="{name}_slip" kp="400" kv="4"/>' for name in slipping)
    sensors = "".join(f'<jointpos name="{name}" joint="{name}"/>' for name in counted)
    step = STEP / substeps
    return f"""<mujoco><option timestep="{step}" integrator="Euler" cone="elliptic" impratio="{stiff}"/>
<default><geom solref="{2 * step} 1" solimp="0.995 0.995 0.001" contype="1" conaffinity="2"/>
<default class="tyre"><geom friction="{grip} 0 0" condim="3" mass="1"/></default>
<default class="load"><geom contype="0" conaffinity="0"/></default></default>
<worldbody><geom type="plane" size="0 0 1" condim="1" friction="0.001 0 0" contype="2" conaffinity="1"/>
<body name="base"><freejoint name="base"/>{robot}</body></worldbody>
<actuator>{actuators}</actuator>{more}
<sensor>{sensors}<framepos name="at" objtype="xbody" objname="base"/>
<framexaxis name="ahead" objtype="xbody" objname="base"/></sensor></mujoco>"""


def driven(*joints: str, stiff: float = 10.0) -> str:
    return "".join(f'<velocity joint="{name}" kv="{stiff}"/>' for name in joints)
