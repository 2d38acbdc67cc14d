"""A robot that follows a target which somebody moves, live: what `nmm drive` shows.

targets   a task's target as a `Signal`, with what a page needs to know of it
choices   what a driver may change: resolver, gains, weights, limits
setups    controllers for what was chosen, of a scenario or of a robot with tasks
driven    the robot, its controller and its time, step by step
surroundings  obstacles in the page
plotted   the curves: channels, and their values
making    a controller made in a thread, while another one goes on
messages  what a page may say
session   the loop in real time, between the pages' messages and their pictures
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
