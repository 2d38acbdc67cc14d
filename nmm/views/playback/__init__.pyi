from nmm.plugins.live.live import LiveViewer as LiveViewer
from nmm.plugins.live.live import play as play
from nmm.plugins.live.running import LiveRun as LiveRun
from nmm.plugins.live.viewer import view as view

from .cameras import Camera as Camera
from .ellipsoids import EllipsoidOptions as EllipsoidOptions
from .html import Page as Page
from .html import write_html as write_html
from .obstacles import Nearest as Nearest
from .rolling import Motion as Motion
from .rolling import wheel_angles as wheel_angles
from .rolling import wheel_rates as wheel_rates
from .shapes import Body as Body
from .shapes import Carried as Carried
from .shapes import Surroundings as Surroundings
