"""The disturbances of a scenario."""

from nmm.model.robots.robot import Robot
from nmm.motion.disturbances import Disturbances
from nmm.motion.localisation import Localisation
from nmm.scenario.constructors import MadePart, keys_of
from nmm.scenario.numbers import NumbersByName


class LocalisationPart(keys_of(Localisation, MadePart)):  # type: ignore[misc]  # made
    """What a simulated robot has beside its wheels to know where it is, for a filter of it all."""

    makes = Localisation


SPELLED = {"noise": NumbersByName, "slip": NumbersByName, "localisation": LocalisationPart}


class DisturbancesPart(keys_of(Disturbances, MadePart, **SPELLED)):  # type: ignore[misc]  # made
    """What a real robot does to the controller, with method zoh."""

    makes = Disturbances

    def build(self, robot: Robot, dt: float) -> Disturbances:
        disturbances: Disturbances = self.make()
        with self.own_keys():
            disturbances.on(robot, dt)
        return disturbances
