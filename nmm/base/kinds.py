"""Every kind of platform, task, reference, objective, resolver and limit, registered once, by name.

A class is imported when it is first asked for, so that the names alone cost nothing.
"""

import re
from collections import UserDict
from collections.abc import Callable, Iterator
from pkgutil import resolve_name
from typing import Any, TypeVar

from nmm.base.errors import expect_known
from nmm.base.plugins import Addition, additions, complain

T = TypeVar("T")


class Kinds(UserDict[str, Any]):
    """Classes, "package.module:Class", by name in the order of listings; errors call one of them `what`.

    Plugins' follow nmm's own: shipped ones where a name is not among these, and strangers' (`nmm.plugins`)
    where it is not among those either, or all are listed.
    """

    def __init__(self, what: str, **classes: str) -> None:
        super().__init__(classes)
        self.what = what
        self._own = tuple(classes)
        self._plugins: dict[str, str] = {}  #: the plugin of each name that is one's
        self._left_out: set[str] = set()

    def __getitem__(self, name: str) -> Any:
        if name not in self:
            raise KeyError(name)
        kind = self.data[name]
        if isinstance(kind, str):
            kind = self.data[name] = resolve_name(kind)
        elif isinstance(kind, Addition):
            kind = kind.load()
            if kind is None:
                self._leave_out(name)
                raise KeyError(name)
            self.data[name] = kind
        return kind

    def __contains__(self, name: object) -> bool:
        return name in self.data or name in self._added(foreign=False) or name in self._added()

    def __iter__(self) -> Iterator[str]:
        return iter(self._added())

    def __len__(self) -> int:
        return len(self._added())

    def _added(self, foreign: bool = True) -> dict[str, Any]:
        """The table, with what plugins add."""
        for name, addition in additions(self.what, self._own, foreign).items():
            if name not in self._left_out:
                self._plugins.setdefault(name, addition.plugin)
                self.data.setdefault(name, addition)
        return self.data

    def _leave_out(self, name: str) -> None:
        del self.data[name]
        self._left_out.add(name)

    def made(self, make: Callable[[str, Any], T]) -> dict[str, T]:
        """What is made of each class, by name; a plugin's class that does not allow it is left out."""
        results = {}
        for name in list(self):
            try:
                results[name] = make(name, self[name])
            except Exception as error:  # whatever a stranger's class is
                if name not in self._plugins:
                    raise
                if name in self.data:
                    text = f"{self.what} {name}: {type(error).__name__}: {error}; it is left out"
                    complain(self._plugins[name], text)
                    self._leave_out(name)
        return results

    def named(self, name: str) -> Any:
        if name not in self:
            expect_known(self.what, name, list(self))
        return self[name]

    def words(self, name: str) -> str:
        """What a class is called in a sentence: "reduced gradient"; the class is not imported."""
        kind = self.data[name]
        entry = kind.entry if isinstance(kind, Addition) else kind
        own = entry.rpartition(":")[2] if isinstance(entry, str) else entry.__name__
        words = re.findall("[A-Z][a-z]*", own)
        return " ".join(word if word in NAMES else word.lower() for word in words)


#: Words that are a person's name.
NAMES = ("Jacobian",)

PLATFORMS = Kinds(
    "platform",
    unicycle="nmm.model.platforms.unicycle:Unicycle",
    differential="nmm.model.platforms.unicycle:DifferentialDrive",
    skid_steer="nmm.model.platforms.skid_steer:SkidSteer",
    car="nmm.model.platforms.car:Car",
    front_drive_car="nmm.model.platforms.car:FrontDriveCar",
    tractor="nmm.model.platforms.tractor:Tractor",
    omnidirectional="nmm.model.platforms.omnidirectional:Omnidirectional",
    mecanum="nmm.model.platforms.omnidirectional:Mecanum",
    fixed="nmm.model.platforms.omnidirectional:FixedBase",
    wheeled="nmm.model.platforms.wheeled.platform:WheeledPlatform",
)
TASKS = Kinds(
    "task",
    position="nmm.control.functions.tasks.position:Position",
    orientation="nmm.control.functions.tasks.pose:Orientation",
    pose="nmm.control.functions.tasks.pose:Pose",
    pointing="nmm.control.functions.tasks.pointing:Pointing",
    heading="nmm.control.functions.tasks.pointing:Heading",
    distance="nmm.control.functions.tasks.position:Distance",
    image_points="nmm.control.functions.tasks.image:ImagePoints",
    image_moments="nmm.control.functions.tasks.image:ImageMoments",
    image_line="nmm.control.functions.tasks.image:ImageLine",
    log_depth="nmm.control.functions.tasks.image:LogDepth",
    center_of_mass="nmm.control.functions.tasks.position:CenterOfMass",
    coordinates="nmm.control.functions.tasks.linear_coordinates:LinearCoordinates",
    posture="nmm.control.functions.tasks.linear_coordinates:Posture",
)
REFERENCES = Kinds(
    "reference",
    circle="nmm.control.functions.references.circle:Circle",
    line="nmm.control.functions.references.polynomial:Line",
    constant="nmm.control.functions.references.polynomial:Constant",
    polynomial="nmm.control.functions.references.polynomial:Polynomial",
    spline="nmm.control.functions.references.polynomial:Spline",
    bearing="nmm.control.functions.references.circle:Bearing",
    measured_points="nmm.control.functions.tasks.measured:MeasuredPoints",
    slerp="nmm.control.functions.references.orientation:Slerp",
    turn="nmm.control.functions.references.orientation:SteadyTurn",
    pose="nmm.control.functions.references.orientation:PoseReference",
    velocity="nmm.control.functions.references.circle:VelocityOf",
)
OBJECTIVES = Kinds(
    "objective",
    quadratic="nmm.control.functions.objectives.coordinates:Quadratic",
    posture="nmm.control.functions.objectives.coordinates:PreferredPosture",
    alignment="nmm.control.functions.objectives.alignment:Alignment",
    joint_range="nmm.control.functions.objectives.coordinates:JointRange",
    limit_barrier="nmm.control.functions.objectives.coordinates:LimitBarrier",
    manipulability="nmm.control.functions.objectives.manipulability:Manipulability",
    weighted_manipulability="nmm.control.functions.objectives.manipulability:WeightedManipulability",
    directional_manipulability="nmm.control.functions.objectives.manipulability:DirectionalManipulability",
    inverse_condition="nmm.control.functions.objectives.manipulability:InverseCondition",
    potential_energy="nmm.control.functions.objectives.potential_energy:PotentialEnergy",
    clearance="nmm.control.functions.objectives.clearance:Clearance",
)
RESOLVERS = Kinds(
    "resolver",
    rg="nmm.control.resolvers.reduced_gradient:ReducedGradient",
    pg="nmm.control.resolvers.projected_gradient:ProjectedGradient",
    ej="nmm.control.resolvers.extended_jacobian:ExtendedJacobian",
    dls="nmm.control.resolvers.damped_least_squares:DampedLeastSquares",
)
LIMITS = Kinds(
    "limit",
    hand_speed="nmm.control.limits.hand_speed:HandSpeed",
    tip_over="nmm.control.limits.tip_over:TipOver",
)
