"""`python tests/helpers/real_robots.py [NAME ...]`: robots from PyPI, from `nmm init` to a completed run.

Each robot's package is installed into a folder that goes again. The platform is the robot's true one, and the
rates of its wheels are those of the speeds of their contact points, by Pinocchio's own reader of the file and
numbers that are written here; of bases on two wheels also those at which MuJoCo's wheels roll without slip.
It is no part of the gate: it needs the network.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

import nmm
from nmm.views.playback import wheel_rates

#: Rates may differ by this share of the largest: radii and files have three digits.
ALIKE = 1e-3
#: Lengths of what is true and of what nmm measures, m.
NEAR = 1e-3


@dataclass(frozen=True)
class Wheel:
    """A wheel in the root link with all joints at zero: the middle of its tyre (2,) m, its axis (3,)."""

    place: np.ndarray
    axis: np.ndarray
    radius: float


@dataclass(frozen=True)
class Case:
    """package with its version, the file in it, options of `nmm init`, platforms that are right, and wheels:
    by joint their radius, and how far along its axis the tyre's middle is from the joint, m."""

    package: str
    file: str
    platforms: tuple[str, ...]
    wheels: Mapping[str, tuple[float, float]]
    options: tuple[str, ...] = ()
    steered: Mapping[str, str] | None = None
    by_mujoco: bool = False
    check: Callable[[nmm.Robot, Mapping[str, Wheel]], None] | None = None


def three_omni_wheels(robot: nmm.Robot, wheels: Mapping[str, Wheel]) -> None:
    """30, 150 and 270 degrees, on 0.174 m."""
    angles = sorted(math.degrees(math.atan2(*wheel.place[::-1])) % 360.0 for wheel in wheels.values())
    np.testing.assert_allclose(angles, [30.0, 150.0, 270.0], atol=0.01)
    np.testing.assert_allclose([np.linalg.norm(one.place) for one in wheels.values()], 0.174, atol=NEAR)


def tyres_apart(track: float, coordinates: int | None = None) -> Callable[..., None]:
    """The middles of the two tyres, m, here and as nmm measures them; and how many coordinates are left."""

    def check(robot: nmm.Robot, wheels: Mapping[str, Wheel]) -> None:
        left, right = wheels.values()
        np.testing.assert_allclose(np.linalg.norm(left.place - right.place), track, atol=NEAR)
        left_y, right_y = (wheel.center[1] for wheel in robot.wheels)
        np.testing.assert_allclose(abs(left_y - right_y), track, atol=NEAR)
        assert coordinates in (None, robot.n), robot.q_names

    return check


#: Radii and tyres as the makers' drawings have them.
ROBOTS = {
    "Stretch 4": Case(
        "hello-robot-stretch4-urdf==2026.10.20",
        "stretch4_urdf/SE4.xacro",
        ("omnidirectional",),
        {f"wheel_{k}_joint": (0.1, 0.0) for k in range(3)},
        ("-a", "batch=francis", "-a", "tool=eoa_wrist_dw4_tool_sg4", "-a", "pkg_path={folder}"),
        check=three_omni_wheels,
    ),
    "Vega": Case(
        "dexmate-urdf==0.8.4",
        "dexmate_urdf/robots/humanoid/vega_1/vega_1.urdf",
        ("omnidirectional", "wheeled"),
        {"L_wheel_j2": (0.0864, 0.0395), "R_wheel_j2": (0.0864, 0.0395)},
        steered={"L_wheel_j2": "L_wheel_j1", "R_wheel_j2": "R_wheel_j1"},
    ),
    "Upkie": Case(
        "upkie-description==2.2.0",
        "upkie_description/urdf/upkie.urdf",
        ("unicycle", "differential"),
        {"left_wheel": (0.05, -0.046), "right_wheel": (0.05, -0.046)},
        by_mujoco=True,
        check=tyres_apart(0.3048, coordinates=3),  # the legs stand still
    ),
    "LeKiwi": Case(
        "physicalai-lekiwi-plugin==0.3.1",
        "urdf/lekiwi/urdf/LeKiwi.urdf",
        ("omnidirectional",),
        {
            "ST3215_Servo_Motor-v1_Revolute-64": (0.0508, 0.02305),
            "ST3215_Servo_Motor-v1-1_Revolute-62": (0.0508, 0.02305),
            "ST3215_Servo_Motor-v1-2_Revolute-60": (0.0508, 0.02305),
        },
    ),
    "Stretch 3": Case(
        "hello-robot-stretch-urdf==0.1.2",
        "stretch_urdf/SE3/stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf",
        ("unicycle", "differential"),
        {"joint_left_wheel": (0.0508, -0.0127), "joint_right_wheel": (0.0508, 0.0127)},
        by_mujoco=True,
        check=tyres_apart(0.3154),
    ),
    "Alicia M": Case(
        "synriard==1.2.4",
        "synriard/urdf/Alicia_M_v1_2/Alicia_M_v1_2_follower.urdf",
        ("unicycle",),  # an arm: on nmm's own base
        {},
    ),
}


def main(names: list[str]) -> int:
    failed = 0
    for name, case in ROBOTS.items():
        if names and name not in names:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                print(f"{name:10} {checked(case, Path(folder))}", flush=True)
            except Exception as error:
                failed = 1
                print(f"{name:10} FAULT {type(error).__name__}: {error}", flush=True)
    return failed


def checked(case: Case, folder: Path) -> str:
    """The line on one robot; an error where something is wrong."""
    packages = folder / "packages"
    python = [sys.executable, "-m"]
    pip = [
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--ignore-requires-python",
        "--disable-pip-version-check",
        "--target",
        str(packages),
    ]
    command([*python, *pip, case.package], folder)
    file = packages / case.file
    options = [option.format(folder=file.parent) for option in case.options]
    said = command([*python, "nmm", "init", str(file), "--out", "S.yaml", *options], folder)
    command([*python, "nmm", "run", "S.yaml", "--out", "run"], folder)
    run = nmm.Trajectory.load(folder / "run")
    robot = run.robot
    assert run.outcome == "completed", run.message
    assert robot.platform.name in case.platforms, robot.platform.name
    codes = {one.code for one in (*run.findings, *run.torques().findings)}
    assert not codes & {"tips", "wheels_slid"}, codes
    if not case.wheels:
        return f"{robot.platform.name}, {run.outcome}: {said.splitlines()[0]}"
    assert {*case.wheels} <= {wheel.joint for wheel in robot.wheels}, robot.wheels
    text = expanded(file, robot)
    wheels = wheels_of(text, case)
    if case.check is not None:
        case.check(robot, wheels)
    rates = {"own": own_rates(run, wheels, case, text)}
    if case.by_mujoco:
        rates["MuJoCo"] = mujoco_rates(run, wheels)
    came = nmm_rates(run, case)
    off = {
        judge: float(np.abs(np.array([came[one] - right[one] for one in right])).max())
        for judge, right in rates.items()
    }
    largest = max(np.abs(one).max() for one in came.values())
    assert largest > 0.1, largest  # they do turn
    assert max(off.values()) < ALIKE * largest, off
    return f"{robot.platform.name}, {run.outcome}: " + ", ".join(
        f"{value:.1e} rad/s off {judge}" for judge, value in off.items()
    )


def command(words: list[str], folder: Path) -> str:
    made = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert made.returncode == 0, f"{' '.join(words[2:4])}: {made.stderr.strip()}"
    return made.stdout


def expanded(file: Path, robot: nmm.Robot) -> str:
    if file.suffix != ".xacro":
        return file.read_text(encoding="utf-8")
    import xacro

    return str(xacro.process_file(str(file), mappings=dict(robot.arguments)).toxml())


def model_of(text: str) -> tuple[pin.Model, pin.Data]:
    model = pin.buildModelFromXML(text)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    return model, data


def wheels_of(text: str, case: Case) -> dict[str, Wheel]:
    """By joint; axes are those that the file gives, in the root link."""
    model, data = model_of(text)
    joints = {one.get("name"): one for one in ElementTree.fromstring(text).iter("joint")}
    found = {}
    for name, (radius, aside) in case.wheels.items():
        axis = np.array([float(one) for one in joints[name].find("axis").get("xyz").split()])  # type: ignore[union-attr]
        placement = data.oMi[model.getJointId(name)]
        axis = placement.rotation @ axis / np.linalg.norm(axis)
        found[name] = Wheel((placement.translation + aside * axis)[:2], axis, radius)
    return found


def in_root(run: nmm.Trajectory) -> np.ndarray:
    """The root link's velocity in its own axes, (N, 3): m/s along x and y, rad/s, by Pinocchio."""
    model, data = run.robot.model, run.robot.model.createData()
    root = next(
        i
        for i, one in enumerate(model.frames)
        if model.names[one.parentJoint] == "theta" and one.type == pin.BODY
    )
    found = np.zeros((len(run.t), 3))
    for k, (q, u) in enumerate(zip(run.q, run.u, strict=True)):
        pin.forwardKinematics(model, data, q, run.robot.S(q) @ u)
        velocity = pin.getFrameVelocity(model, data, root, pin.LOCAL)
        found[k] = *velocity.linear[:2], velocity.angular[2]
    return found


def own_rates(
    run: nmm.Trajectory, wheels: Mapping[str, Wheel], case: Case, text: str
) -> dict[str, np.ndarray]:
    """The contact point is still where the wheel grips: the centre's velocity along axis x up is r times the
    rate. A steered wheel points along its pivot's velocity: its rate is that over r, either way round."""
    moved = in_root(run)
    if case.steered:
        model, data = model_of(text)
        wheels = {
            name: Wheel(data.oMi[model.getJointId(case.steered[name])].translation[:2], one.axis, one.radius)
            for name, one in wheels.items()
        }
    found = {}
    for name, wheel in wheels.items():
        x, y = wheel.place
        at = np.column_stack([moved[:, 0] - moved[:, 2] * y, moved[:, 1] + moved[:, 2] * x])
        if case.steered:
            found[name] = np.linalg.norm(at, axis=1) / wheel.radius
        else:
            ahead = np.cross(wheel.axis, [0.0, 0.0, 1.0])[:2]
            found[name] = at @ ahead / np.linalg.norm(ahead) / wheel.radius
    return found


def nmm_rates(run: nmm.Trajectory, case: Case) -> dict[str, np.ndarray]:
    """As playback turns them; of steered wheels the size."""
    names = [wheel.joint for wheel in run.robot.wheels]
    every = np.array([wheel_rates(run.robot, q, u)[: len(names)] for q, u in zip(run.q, run.u, strict=True)])
    rates = {name: every[:, names.index(name)] for name in case.wheels}
    return {name: np.abs(one) for name, one in rates.items()} if case.steered else rates


def mujoco_rates(run: nmm.Trajectory, wheels: Mapping[str, Wheel]) -> dict[str, np.ndarray]:
    """Rates at which the lowest points of MuJoCo's wheels have no velocity along the ground ahead."""
    import mujoco  # type: ignore[import-untyped]

    bodies = "".join(
        f'<body name="{name}" pos="{one.place[0]} {one.place[1]} {one.radius}">'
        f'<joint name="{name}" axis="{" ".join(map(str, one.axis))}"/>'
        f'<geom type="sphere" size="{one.radius}"/></body>'
        for name, one in wheels.items()
    )
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>'
        '<joint name="y" type="slide" axis="0 1 0"/><joint name="theta" axis="0 0 1"/>'
        f'<geom size="0.1"/>{bodies}</body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    found = {name: np.zeros(len(run.t)) for name in wheels}
    for k, (vx, vy, omega) in enumerate(in_root(run)):
        data.qpos[:3] = 0.0, 0.0, 0.7  # the root link's velocity, turned with it
        mujoco.mj_forward(model, data)
        turned = np.exp(0.7j) * complex(vx, vy)
        for name, wheel in wheels.items():
            body, joint = model.body(name).id, model.joint(name).dofadr[0]
            jacobian = np.zeros((3, model.nv))
            lowest = data.xpos[body] - [0.0, 0.0, wheel.radius]
            mujoco.mj_jac(model, data, jacobian, None, lowest, body)
            ahead = np.cross(data.xaxis[joint], [0.0, 0.0, 1.0])
            slip = ahead @ jacobian
            found[name][k] = -slip[:3] @ [turned.real, turned.imag, omega] / slip[joint]
    return found


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
