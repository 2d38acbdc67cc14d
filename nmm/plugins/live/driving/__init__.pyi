from .session import drive as drive
from .setups import Choice as Choice
from .setups import DriveSetup as DriveSetup
from .setups import RobotSetup as RobotSetup
from .setups import ScenarioSetup as ScenarioSetup
