from . import ros as ros
