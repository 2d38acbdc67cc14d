from . import figures as figures
from . import folders as folders
from . import playback as playback
from . import tables as tables
