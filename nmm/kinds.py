"""Every kind of platform, task, reference, objective and resolver, registered once, by name.

A class is imported when it is first asked for, so that the names alone cost nothing.
"""

import re
from collections import UserDict
from pkgutil import resolve_name
from typing import Any

from nmm.errors import expect_known


class Kinds(UserDict[str, Any]):
    """Classes, "package.module:Class", by name in the order of listings; errors call one of them `what`."""

    def __init__(self, what: str, **classes: str) -> None:
        super().__init__(classes)
        self.what = what

    def __getitem__(self, name: str) -> Any:
        found = self.data[name]
        if isinstance(found, str):
            found = self.data[name] = resolve_name(found)
        return found

    def named(self, name: str) -> Any:
        expect_known(self.what, name, self.data)
        return self[name]

    def words(self, name: str) -> str:
        """What a class is called in a sentence: "reduced gradient"; the class is not imported."""
        found = self.data[name]
        own = found.rpartition(":")[2] if isinstance(found, str) else found.__name__
        words = re.findall("[A-Z][a-z]*", own)
        return " ".join(word if word in NAMES else word.lower() for word in words)


#: Words that are a person's name.
NAMES = ("Jacobian",)

PLATFORMS = Kinds(
    "platform",
    unicycle="nmm.platforms.unicycle:Unicycle",
    differential="nmm.platforms.unicycle:DifferentialDrive",
    skid_steer="nmm.platforms.skid_steer:SkidSteer",
    car="nmm.platforms.car:Car",
    front_drive_car="nmm.platforms.car:FrontDriveCar",
    tractor="nmm.platforms.tractor:Tractor",
    omnidirectional="nmm.platforms.omnidirectional:Omnidirectional",
    mecanum="nmm.platforms.omnidirectional:Mecanum",
    fixed="nmm.platforms.omnidirectional:FixedBase",
    wheeled="nmm.platforms.wheeled.platform:WheeledPlatform",
)
TASKS = Kinds(
    "task",
    position="nmm.functions.tasks.position:Position",
    orientation="nmm.functions.tasks.pose:Orientation",
    pose="nmm.functions.tasks.pose:Pose",
    pointing="nmm.functions.tasks.pointing:Pointing",
    heading="nmm.functions.tasks.pointing:Heading",
    distance="nmm.functions.tasks.position:Distance",
    image_points="nmm.functions.tasks.image:ImagePoints",
    image_moments="nmm.functions.tasks.image:ImageMoments",
    image_line="nmm.functions.tasks.image:ImageLine",
    log_depth="nmm.functions.tasks.image:LogDepth",
    center_of_mass="nmm.functions.tasks.position:CenterOfMass",
    coordinates="nmm.functions.tasks.linear_coordinates:LinearCoordinates",
    posture="nmm.functions.tasks.linear_coordinates:Posture",
    parking="nmm.plans.parking:Parking",
)
REFERENCES = Kinds(
    "reference",
    circle="nmm.functions.references.circle:Circle",
    line="nmm.functions.references.polynomial:Line",
    constant="nmm.functions.references.polynomial:Constant",
    polynomial="nmm.functions.references.polynomial:Polynomial",
    spline="nmm.functions.references.polynomial:Spline",
    bearing="nmm.functions.references.circle:Bearing",
    measured_points="nmm.functions.tasks.measured:MeasuredPoints",
    slerp="nmm.functions.references.orientation:Slerp",
    turn="nmm.functions.references.orientation:SteadyTurn",
    pose="nmm.functions.references.orientation:PoseReference",
    velocity="nmm.functions.references.circle:VelocityOf",
)
OBJECTIVES = Kinds(
    "objective",
    quadratic="nmm.functions.objectives.coordinates:Quadratic",
    posture="nmm.functions.objectives.coordinates:PreferredPosture",
    alignment="nmm.functions.objectives.alignment:Alignment",
    joint_range="nmm.functions.objectives.coordinates:JointRange",
    limit_barrier="nmm.functions.objectives.coordinates:LimitBarrier",
    manipulability="nmm.functions.objectives.manipulability:Manipulability",
    weighted_manipulability="nmm.functions.objectives.manipulability:WeightedManipulability",
    directional_manipulability="nmm.functions.objectives.manipulability:DirectionalManipulability",
    inverse_condition="nmm.functions.objectives.manipulability:InverseCondition",
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
