"""Where the project is, and robots' files of example-robot-data."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = "package://example-robot-data/robots/"
UR5 = DATA + "ur_description/urdf/ur5_robot.urdf"
PANDA = DATA + "panda_description/urdf/panda.urdf"
