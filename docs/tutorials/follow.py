"""The logic of ros_node.py: from ROS 2's messages to inputs, without ROS."""

import nmm


class Follow:
    """Keeps a frame at a target that comes as a PoseStamped."""

    def __init__(self, robot, frame, messages, dt=0.01):
        self.robot, self.messages, self.dt = robot, messages, dt
        self.target = nmm.LiveTarget([0.5, 0.0, 1.1])
        task = nmm.Task(nmm.Position(frame), self.target, gain=2.0, speed=0.3)
        limits = nmm.Limits(
            velocity={"v": 0.5, "omega": 1.0, "arm": 1.0}, acceleration={"platform": 1.0, "arm": 3.0}
        )
        self.loop = nmm.Loop(nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits, dt=dt))
        self.frames = nmm.ros.Transforms()
        self.q, self.measured = None, None

    def on_tf(self, message):
        self.frames.add(message)

    def on_target(self, message):
        self.target.set(nmm.ros.placement(message)[:3, 3])

    def on_joint_state(self, message):
        base = self.frames.base("map", self.messages.base)
        self.q = self.robot.q_from(nmm.ros.joints(message), base, near=self.q)
        self.measured = nmm.ros.stamp(message)

    def commands(self, t):
        """(Twist, {joint: rate}) at the time t, s, once every dt; at rest where nothing is measured."""
        u = self.loop.step(t, self.q, self.measured)
        q = self.robot.rest if self.q is None else self.q
        rates = dict(zip(self.robot.u_names, map(float, u), strict=True))
        return self.messages.twist(q, u), {name: rates[name] for name in self.robot.q_names[3:]}
