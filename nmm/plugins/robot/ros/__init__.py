"""ROS 2's messages and bags, without ROS: messages are read and made by the names of their fields.

What reads works on the messages of rclpy and of the package rosbags, and on whatever has such fields.
Frames are REP-105's (map, odom, the base), units REP-103's. Bags need the extra `ros`.
"""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
