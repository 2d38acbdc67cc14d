from .ellipsoids import EllipsoidOptions as EllipsoidOptions
from .html import write_html as write_html
from .live import LiveViewer as LiveViewer
from .live import play as play
from .rolling import Motion as Motion
from .rolling import wheel_angles as wheel_angles
from .rolling import wheel_rates as wheel_rates
from .viewer import view as view
