"""The two workloads of `run.py`, as numbers that a program without nmm can read.

Both are scenarios of the project with the projected gradient and Euler's rule. A library that is compared
gets the robot as URDF text, made here from the very model that nmm uses: the same placements, axes, limits
and inertias, no shapes. In front of the robot stand the joints of its base, in one of two ways:

rolls    `forward` (along x) and `turn` (about z): the inputs of a unicycle, both at 0 before each step. A
         Jacobian there is exactly J S of the rolling base, so a library that knows no rolling constraint
         solves the nonholonomic problem, in as few variables as nmm; the target is given in the base's
         frame, and the base is moved by what `forward` and `turn` came to.
slides   x, y and theta: an omnidirectional base, which goes sideways as it likes; the target is in the world.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import nmm
from nmm.control.functions.program import Program

#: Where a coordinate has no limit, m or rad: URDF wants one of every joint but those called continuous.
ENDLESS = 1e4
BASES = {
    "rolls": [("forward", "prismatic", "1 0 0", "v"), ("turn", "revolute", "0 0 1", "omega")],
    "slides": [
        ("x", "prismatic", "1 0 0", "v"),
        ("y", "prismatic", "0 1 0", "v"),
        ("theta", "revolute", "0 0 1", "omega"),
    ],
}


class Chosen(NamedTuple):
    """A workload: the scenario, its end-effector, its limits when they are on, and the peers' posture.

    velocity : of inputs that the robot's file leaves free, m/s or rad/s
    position : of coordinates that the robot's file leaves free
    """

    scenario: str
    frame: str
    velocity: dict[str, float]
    position: dict[str, list[float]]
    posture: dict[str, float]


#: The planar robot's q1 goes to 45 deg, as its objective says; the objective's other square, which has theta
#: in it, is no posture, and q2 is given 45 deg, too.
WORKLOADS = {
    "planar": Chosen(
        "unicycle_2r_position",
        "ee",
        {"v": 1.5, "omega": 2.0, "q1": 2.0, "q2": 2.0},
        {"q1": [-2.8, 2.8], "q2": [-2.8, 2.8]},
        {"q1": np.pi / 4, "q2": np.pi / 4},
    ),
    "TIAGo": Chosen("tiago_pose", "arm_tool_link", {"v": 1.0, "omega": 1.0}, {}, {}),
}


class Workload:
    """A workload laid out: the scenario, the path at every sample, the robot's limits.

    Attributes
    ----------
    t (N,) : the times of the samples, s
    p (N + 1, 3) : the path in the world, m, at t and one sample on
    R (3, 3) : the orientation to hold, for a pose
    inputs, coordinates : (lower, upper) by name when limits are on
    """

    def __init__(self, name: str) -> None:
        self.name, self.chosen = name, WORKLOADS[name]
        self.scenario = nmm.Scenario.load(self.chosen.scenario).with_resolver("pg").override("limits", False)
        self.robot = self.scenario.robot()
        self.q0 = self.robot.q(self.scenario.parts.q0)
        self.dt = float(self.scenario.parts.dt)
        self.frame = self.chosen.frame
        self.without_limits = self.scenario.controller()
        (task,) = self.without_limits.task.tasks
        self.gain = float(task.gain)
        self.rows = len(task.rows(self.robot))
        count = round(float(self.scenario.parts.duration) / self.dt)
        self.t = self.dt * np.arange(count)
        reference = Program(self.robot, (task.reference,))
        reference.lay_out()
        found = [reference.evaluate(self.dt * k, self.q0)[0] for k in range(count + 1)]
        start = self.placement(self.q0)
        in_space = min(self.rows, 3)
        self.p = np.tile(start.translation, (count + 1, 1))
        self.p[:, :in_space] = [one.value[:in_space] for one in found]
        self.R = np.eye(3)
        if self.rows == 6 and np.abs([one.value[3:] for one in found]).max() > 0.0:
            raise SystemExit(f"{name}: expected a path whose orientation is the world's, all along")
        self.limits = nmm.Limits(self.chosen.velocity, self.chosen.position or True)
        kept = self.limits.on(self.robot)
        self.inputs = {n: kept.inputs[k].tolist() for k, n in enumerate(self.robot.u_names)}
        self.coordinates = {n: kept.coordinates[k].tolist() for k, n in enumerate(self.robot.q_names)}

    def controller(self, kinematics: str, limits: bool) -> nmm.Controller:
        """nmm's controller of this workload."""
        free = self.without_limits
        return nmm.Controller(
            *(self.robot, free.task, free.resolver, free.given.objective),
            limits=self.limits if limits else None,
            dt=self.dt,
            kinematics=kinematics,
        )

    def placement(self, q: np.ndarray) -> pin.SE3:
        """The end-effector's placement at q, by Pinocchio."""
        model, data = self.robot.model, self.robot.model.createData()
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[self.robot.frame_id(self.frame)].copy()

    def targets(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 3) and orientations (N, 3, 3) to be at after each sample: the path, and what the gain
        K leaves of the error at the start, which shrinks by 1 - K dt a sample."""
        start = self.placement(self.q0)
        share = (1.0 - self.gain * self.dt) ** np.arange(1, len(self.t) + 1)
        p = self.p[1:] + share[:, None] * (start.translation - self.p[0])
        turn = pin.log3(self.R.T @ start.rotation)
        return p, np.array([self.R @ pin.exp3(one * turn) for one in share])

    def posture(self) -> dict[str, float]:
        """The arm's posture that the peers are drawn to: what is said, else the middle of each range."""
        return self.chosen.posture or {
            n: 0.5 * (lower + upper)
            for n, (lower, upper) in self.coordinates.items()
            if np.isfinite(upper - lower)
        }

    def describe(self) -> dict[str, Any]:
        """Everything that a worker without nmm needs, of plain numbers and text."""
        positions, orientations = self.targets()
        posture = self.posture()
        arm = self.robot.q_names[3:]
        return {
            "name": self.name,
            "rows": self.rows,
            "frame": self.frame,
            "dt": self.dt,
            "q0": self.q0.tolist(),
            "arm": list(arm),
            "velocity": {n: min(-low, up) for n, (low, up) in self.inputs.items()},
            "posture": [posture[n] for n in arm],
            "positions": positions.tolist(),
            "orientations": orientations.tolist(),
            "urdf": {base: urdf(self, base) for base in BASES},
        }


def urdf(workload: Workload, base: str) -> str:
    """The robot as URDF text, with the joints of its base in front."""
    robot, model = workload.robot, workload.robot.model
    if [*model.names][4:] != [*robot.q_names[3:]]:
        raise SystemExit(f"{workload.name}: expected a joint a coordinate, in their order")
    neutral = model.createData()
    pin.computeJointJacobians(model, neutral, np.zeros(model.nq))
    links, joints = ['<link name="world_link"/>'], []
    parent = "world_link"
    for k, (name, kind, axis, speed) in enumerate(BASES[base], start=1):
        last = k == len(BASES[base])
        child = "link3" if last else f"base{k}"
        links.append(_link(child, model.inertias[3] if last else pin.Inertia.Zero()))
        range_ = (-ENDLESS, ENDLESS, workload.inputs[speed][1])
        joints.append(_joint(name, kind, parent, child, pin.SE3.Identity(), axis, range_))
        parent = child
    for i in range(4, model.njoints):
        name = model.names[i]
        column = pin.getJointJacobian(model, neutral, i, pin.LOCAL)[:, model.idx_vs[i]]
        slides = np.linalg.norm(column[:3]) > 0.5
        axis = " ".join(repr(float(x)) for x in (column[:3] if slides else column[3:]))
        lower, upper = np.clip(workload.coordinates[name], -ENDLESS, ENDLESS)
        range_ = (lower, upper, workload.inputs[name][1])
        links.append(_link(f"link{i}", model.inertias[i]))
        joints.append(
            _joint(
                name,
                "prismatic" if slides else "revolute",
                f"link{model.parents[i]}",
                f"link{i}",
                model.jointPlacements[i],
                axis,
                range_,
            )
        )
    frame = model.frames[robot.frame_id(workload.frame)]
    links.append(f'<link name="{workload.frame}"/>')
    joints.append(
        _joint("tool_joint", "fixed", f"link{frame.parentJoint}", workload.frame, frame.placement, "", None)
    )
    # MuJoCo reads URDF, too: it is asked to keep bodies that do not move apart, and to give light ones mass.
    compiler = '<mujoco><compiler fusestatic="false" boundmass="1e-3" boundinertia="1e-6"/></mujoco>'
    return "\n".join(['<robot name="robot">', compiler, *links, *joints, "</robot>"])


def _link(name: str, inertia: pin.Inertia) -> str:
    if inertia.mass <= 0.0:
        return f'<link name="{name}"/>'
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = (map(float, row) for row in inertia.inertia)
    return (
        f'<link name="{name}"><inertial><origin xyz="{_numbers(inertia.lever)}"/>'
        f'<mass value="{inertia.mass!r}"/>'
        f'<inertia ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"/>'
        "</inertial></link>"
    )


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    placement: pin.SE3,
    axis: str,
    limit: tuple[float, float, float] | None,
) -> str:
    turned = _numbers(pin.rpy.matrixToRpy(placement.rotation))
    moves = ""
    if limit is not None:
        lower, upper, velocity = map(float, limit)
        moves = (
            f'<axis xyz="{axis}"/>'
            f'<limit lower="{lower!r}" upper="{upper!r}" velocity="{velocity!r}" effort="100"/>'
        )
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(placement.translation)}" rpy="{turned}"/>{moves}</joint>'
    )


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in values)


def write(folder: Path) -> Path:
    """The file of both workloads that the workers read."""
    told = {}
    for name in WORKLOADS:
        told[name] = Workload(name).describe()
        for base, text in told[name]["urdf"].items():
            path = folder / f"{name}_{base}.urdf"
            path.write_text(text)
            told[name]["urdf"][base] = str(path)
    path = folder / "workloads.json"
    path.write_text(json.dumps(told))
    return path
