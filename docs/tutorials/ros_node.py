"""The node of ros.md: needs ROS 2, and follow.py of that page beside it."""

import rclpy
from follow import Follow
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from tf2_msgs.msg import TFMessage

import nmm


class FollowNode(Node):
    def __init__(self):
        super().__init__("follow")
        robot = nmm.load("unicycle_3r")
        self.follow = Follow(robot, "ee", nmm.ros.Messages(robot))
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(TFMessage, "/tf", self.guarded(self.follow.on_tf), 100)
        self.create_subscription(TFMessage, "/tf_static", self.guarded(self.follow.on_tf), latched)
        self.create_subscription(JointState, "/joint_states", self.guarded(self.follow.on_joint_state), 10)
        self.create_subscription(PoseStamped, "/target", self.guarded(self.follow.on_target), 10)
        self.twist = self.create_publisher(Twist, "/cmd_vel", 10)
        self.arm = self.create_publisher(Float64MultiArray, "/arm_velocity_controller/commands", 10)
        self.create_timer(self.follow.dt, self.step)

    def guarded(self, callback):
        """Messages that say nothing are told and left aside; the watchdog sees that none came."""

        def call(message):
            try:
                callback(message)
            except nmm.InputError as error:
                self.get_logger().warning(str(error), throttle_duration_sec=1.0)

        return call

    def step(self):
        now = self.get_clock().now().nanoseconds / 1e9
        twist, rates = self.follow.commands(now)
        self.twist.publish(twist)
        self.arm.publish(Float64MultiArray(data=list(rates.values())))


def main():
    rclpy.init()
    rclpy.spin(FollowNode())


if __name__ == "__main__":
    main()
