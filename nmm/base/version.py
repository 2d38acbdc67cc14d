"""The version of nmm."""

__version__ = "1.0.0"
