"""Every kind of platform, task, reference, objective and resolver, registered here once, by name.

Scenario files with their keys and defaults, the command line's help, figures, documentation and the tests'
grids read these lists. A line names the class; it is imported when it is first asked for, so that the names
alone cost nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, MutableMapping
from pkgutil import resolve_name
from typing import Any

from nmm.errors import expect_known


class Kinds(MutableMapping[str, Any]):
    """Classes by name, in the order in which they are listed for people.

    Parameters
    ----------
    what : the word for one of them, as errors say it
    classes : "package.module:Class" by name
    """

    def __init__(self, what: str, **classes: str) -> None:
        self.what = what
        self._classes: dict[str, str | type] = dict(classes)

    def __getitem__(self, name: str) -> Any:
        found = self._classes[name]
        if isinstance(found, str):
            found = self._classes[name] = resolve_name(found)
        return found

    def __setitem__(self, name: str, kind: type) -> None:
        self._classes[name] = kind

    def __delitem__(self, name: str) -> None:
        del self._classes[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._classes)

    def __len__(self) -> int:
        return len(self._classes)

    def named(self, name: str) -> Any:
        """The class of that name; `InputError` lists the names."""
        expect_known(self.what, name, self._classes)
        return self[name]

    def words(self, name: str) -> str:
        """What a class is called in a sentence: "reduced gradient"; the class is not imported."""
        found = self._classes[name]
        own = found.rpartition(":")[2] if isinstance(found, str) else found.__name__
        words = re.findall("[A-Z][a-z]*", own)
        return " ".join(word if word in NAMES else word.lower() for word in words)


#: Words that are a person's name.
NAMES = ("Jacobian",)

PLATFORMS = Kinds(
    "platform",
    unicycle="nmm.platforms.unicycle:Unicycle",
    differential="nmm.platforms.differential_drive:DifferentialDrive",
    skid_steer="nmm.platforms.skid_steer:SkidSteer",
    car="nmm.platforms.car:Car",
    front_drive_car="nmm.platforms.car:FrontDriveCar",
    tractor="nmm.platforms.tractor:Tractor",
    omnidirectional="nmm.platforms.omnidirectional:Omnidirectional",
    mecanum="nmm.platforms.mecanum:Mecanum",
    fixed="nmm.platforms.fixed:Fixed",
    wheeled="nmm.platforms.wheeled.platform:WheeledPlatform",
)
TASKS = Kinds(
    "task",
    position="nmm.functions.tasks.position:Position",
    orientation="nmm.functions.tasks.orientation:Orientation",
    pose="nmm.functions.tasks.pose:Pose",
    pointing="nmm.functions.tasks.pointing:Pointing",
    heading="nmm.functions.tasks.heading:Heading",
    distance="nmm.functions.tasks.distance:Distance",
    center_of_mass="nmm.functions.tasks.center_of_mass:CenterOfMass",
    coordinates="nmm.functions.tasks.coordinates:Coordinates",
    posture="nmm.functions.tasks.posture:Posture",
)
REFERENCES = Kinds(
    "reference",
    circle="nmm.functions.references.circle:Circle",
    line="nmm.functions.references.polynomial:Line",
    constant="nmm.functions.references.polynomial:Constant",
    polynomial="nmm.functions.references.polynomial:Polynomial",
    spline="nmm.functions.references.polynomial:Spline",
    bearing="nmm.functions.references.bearing:Bearing",
    slerp="nmm.functions.references.orientation:Slerp",
    turn="nmm.functions.references.orientation:Turn",
    pose="nmm.functions.references.pose:PoseReference",
    velocity="nmm.functions.references.velocity:Velocity",
)
OBJECTIVES = Kinds(
    "objective",
    quadratic="nmm.functions.objectives.quadratic:Quadratic",
    posture="nmm.functions.objectives.preferred_posture:PreferredPosture",
    alignment="nmm.functions.objectives.alignment:Alignment",
    joint_range="nmm.functions.objectives.joint_range:JointRange",
    limit_barrier="nmm.functions.objectives.limit_barrier:LimitBarrier",
    manipulability="nmm.functions.objectives.manipulability:Manipulability",
    weighed_manipulability="nmm.functions.objectives.manipulability:WeighedManipulability",
    directional_manipulability="nmm.functions.objectives.directional_manipulability:DirectionalManipulability",
    inverse_condition="nmm.functions.objectives.inverse_condition:InverseCondition",
    potential_energy="nmm.functions.objectives.potential_energy:PotentialEnergy",
    clearance="nmm.functions.objectives.clearance:Clearance",
)
RESOLVERS = Kinds(
    "resolver",
    rg="nmm.resolvers.reduced_gradient:ReducedGradient",
    pg="nmm.resolvers.projected_gradient:ProjectedGradient",
    ej="nmm.resolvers.extended_jacobian:ExtendedJacobian",
    dls="nmm.resolvers.damped_least_squares:DampedLeastSquares",
)
