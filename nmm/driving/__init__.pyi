from .session import drive as drive
from .setups import RobotSetup as RobotSetup
from .setups import ScenarioSetup as ScenarioSetup
