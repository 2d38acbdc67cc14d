"""The robot of robot_loop.md in MuJoCo."""

import mujoco
import numpy as np
import pinocchio as pin

import nmm


class MujocoRobot:
    """A robot in MuJoCo, made from its display model: its wheels are balls on a floor, the base is free.

    casters : points (x, y), m, where balls without friction carry it besides its wheels
    contact, grip : how hard contacts are (MuJoCo's time constant, s), and the wheels' friction
    """

    def __init__(self, robot, q, casters=(), contact=0.004, grip=1.0, timestep=0.001):
        self.robot, self.dynamics = robot, nmm.Dynamics(robot)
        model, spec = self.dynamics.model, mujoco.MjSpec()
        ball, plane = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_PLANE
        spec.option.timestep, spec.option.cone = timestep, mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.integrator, spec.option.impratio = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, 10
        # Of two surfaces the larger friction counts, so the floor has none.
        hard = {"solref": [contact, 1], "solimp": [0.99, 0.999, 5e-4, 0.5, 2], "contype": 1, "conaffinity": 0}
        slippery, gripping = {"condim": 1, "friction": [0, 0, 0]}, {"condim": 3, "friction": [grip, 0, 0]}
        data, base = model.createData(), model.getJointId("theta")
        pin.computeJointJacobians(model, data, pin.neutral(model))
        bodies, carried = {}, {wheel.joint: wheel for wheel in robot.wheels}
        for k in range(base, model.njoints):
            name, inertia = model.names[k], model.inertias[k]
            parent, at = bodies.get(model.parents[k], spec.worldbody), model.jointPlacements[k]
            place = data.oMi[k] if k == base else at
            x, y, z, w = pin.Quaternion(place.rotation).coeffs()
            body = bodies[k] = parent.add_body(name=name, pos=place.translation, quat=[w, x, y, z])
            about = inertia.inertia + 1e-9 * np.eye(3)
            body.explicitinertial, body.mass, body.ipos = True, inertia.mass + 1e-9, inertia.lever
            body.fullinertia = about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            if k == base:
                body.add_freejoint()
            elif name not in self.dynamics.left_out:
                axis = pin.getJointJacobian(model, data, k, pin.LOCAL)[:, model.joints[k].idx_v]
                slides = np.abs(axis[:3]).max() > 0.5
                kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
                body.add_joint(name=name, type=kind, axis=axis[:3] if slides else axis[3:])
                if name in carried:
                    body.add_geom(type=ball, size=[carried[name].radius, 0, 0], **gripping, **hard)
        wheels = [wheel for wheel in robot.wheels if wheel.joint in self.dynamics.actuators.names]
        floor = min(data.oMi[model.getJointId(one.joint)].translation[2] - one.radius for one in wheels)
        spec.worldbody.add_geom(type=plane, size=[50, 50, 1], pos=[0, 0, floor], **slippery)
        for x, y in casters:
            at = data.oMi[base].actInv(np.array([x, y, floor + 0.01]))
            bodies[base].add_geom(type=ball, size=[0.01, 0, 0], pos=at, **slippery, **hard)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        names = self.dynamics.actuators.names
        self.joints = np.array([self.model.joint(name).qposadr[0] for name in names])
        self.dofs = np.array([self.model.joint(name).dofadr[0] for name in names])
        self.wheels = len(names) - (robot.n - 3)
        self.data.qpos[:2], self.data.qpos[3], self.data.qpos[6] = q[:2], np.cos(q[2] / 2), np.sin(q[2] / 2)
        self.data.qpos[self.joints[self.wheels :]] = q[3:]
        mujoco.mj_forward(self.model, self.data)
        # Servos: gains of a mass, the largest of random postures; one from the rest posture is too small.
        rng = np.random.default_rng(0)
        some = [
            robot.q(dict(zip(robot.q_names[3:], x, strict=True)))
            for x in rng.uniform(-1.5, 1.5, (50, robot.n - 3))
        ]
        self.mass = np.max([np.diag(self.dynamics.M(one)) for one in some], axis=0)
        self.wanted, self.efforts = self.encoders(), self.dynamics.actuators.efforts

    def encoders(self):
        """Angles of wheels and joints, as encoders read them."""
        return self.data.qpos[self.joints].copy()

    def readings(self):
        """The same by name."""
        return dict(zip(self.dynamics.actuators.names, self.encoders(), strict=True))

    def rates(self):
        return self.data.qvel[self.dofs].copy()

    @property
    def q(self):
        """Where it is, which a real robot does not tell."""
        x, y, _, w, _, _, z = self.data.qpos[:7]
        return np.array([x, y, 2 * np.arctan2(z, w), *self.data.qpos[self.joints[self.wheels :]]])

    def apply(self, torques, dt):
        """Motor torques, as far as the motors' limits go, for dt."""
        self.torques = np.clip(torques, -self.efforts, self.efforts)
        self.data.qfrc_applied[self.dofs] = self.torques
        mujoco.mj_step(self.model, self.data, round(dt / self.model.opt.timestep))

    def send(self, u, dt, stiff=30.0):
        """Velocity servos of all motors: each is led by a motor that turns as asked (PI in the rate)."""
        steps = round(dt / self.model.opt.timestep)
        for _ in range(steps):
            self.wanted = self.wanted + u * dt / steps
            behind, slower = self.wanted - self.encoders(), u - self.rates()
            self.apply(self.mass * (stiff**2 * behind + 2 * stiff * slower), dt / steps)
