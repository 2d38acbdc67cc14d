from . import driving as driving
from . import rendering as rendering
