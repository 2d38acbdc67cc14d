"""The logic of ros_node.py: from ROS 2's messages to inputs, without ROS."""

import nmm


class Follow:
    """Keeps a hand at a target that comes as a PoseStamped; speaks in messages."""

    def __init__(self, robot, frame, messages, dt=0.01):
        self.robot, self.messages, self.dt = robot, messages, dt
        self.target = nmm.LiveTarget([0.5, 0.0, 1.1])
        task = nmm.Task(nmm.Position(frame), self.target, gain=2.0, speed=0.3)
        limits = nmm.Limits(
            velocity={"platform": 0.5, "arm": 1.0}, acceleration={"platform": 1.0, "arm": 3.0}
        )
        self.loop = nmm.Loop(nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits, dt=dt))
        self.frames, self.states = nmm.ros.Transforms(), nmm.ros.JointStates(robot)
        self.q, self.measured = None, None

    def on_tf(self, message):
        self.frames.add(message)

    def on_target(self, message):
        self.target.set(nmm.ros.placement(message)[:3, 3])

    def on_joint_state(self, message):
        if self.states.add(message):  # which may have further joints, or a part of them
            base = self.frames.base("map", self.robot)  # its reference point, by any link fixed to it
            self.q = self.robot.q_from(self.states.joints, base, near=self.q)
            self.measured = self.states.stamp

    def commands(self, t):
        """(Twist, {joint: rate}) at the time t, s, once every dt; they stop a robot that nothing measures."""
        u = self.loop.step(t, self.q, self.measured)
        q = self.robot.rest if self.q is None else self.q
        ahead = q + self.dt * self.robot.S(q) @ u  # a car's steering is to be there by then
        p, gear = self.robot.platform.p, self.robot.gear
        arm = zip(self.robot.u_names[p:], map(float, u[p:]), strict=True)
        rates = {joint: rate / gear(joint)[0] for joint, rate in arm}  # as its encoder counts
        return self.messages.twist(ahead, u), rates
