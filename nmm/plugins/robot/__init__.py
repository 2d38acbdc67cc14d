"""A real robot: the loop at its clock, odometry, encoders, and ROS 2's messages and bags."""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
