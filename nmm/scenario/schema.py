"""The keys of a scenario, from the top."""

from collections.abc import Collection, Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, create_model

from nmm.base.errors import InputError, Setting, expect_known, few
from nmm.base.kinds import RESOLVERS
from nmm.base.plugins import Addition
from nmm.base.progress import Progress
from nmm.base.text_format import listed as in_words
from nmm.control.controller import Controller
from nmm.control.functions.tasks.task import Stack
from nmm.control.goal import Goal
from nmm.control.limits.collisions import Collisions
from nmm.control.resolvers.base import Resolver
from nmm.control.sequenced import SequencedController
from nmm.control.sequencing.sequence import Sequence
from nmm.model.robots.robot import Robot
from nmm.model.robots.semantics import POSTURE
from nmm.scenario.collisions import CollisionsPart
from nmm.scenario.disturbances import DisturbancesPart
from nmm.scenario.files import Absolute
from nmm.scenario.functions import REFERENCE_PARTS
from nmm.scenario.keys import KeyedError, KeyedPart, at
from nmm.scenario.limits import GoalPart, LimitsPart, RetreatPart, SteeringPart, part_or_none
from nmm.scenario.numbers import Nested, Positive, integer, numbers, numbers_by_name
from nmm.scenario.objectives import ObjectiveList, QuadraticPart, build_objective
from nmm.scenario.resolvers import AnyResolver, WithAddedTask
from nmm.scenario.robot import RobotChoice
from nmm.scenario.scene import ScenePart
from nmm.scenario.sections import Making, Section, SectionMotion, about, section_class, section_names
from nmm.scenario.tasks import TASK_PARTS, TaskList, TaskPart, build_tasks, listed


def start_of(value: object) -> dict[str, Any] | list[Nested]:
    """Numbers by name, one or several postures among them, or a list of numbers."""
    if not isinstance(value, Mapping):
        return numbers(value)
    named, rest = value.get(POSTURE), {name: item for name, item in value.items() if name != POSTURE}
    if POSTURE not in value:
        return numbers_by_name(rest)
    names = [named] if isinstance(named, str) else named
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise KeyedError((POSTURE,), expected="a posture's name, or a list of such", got=named)
    return {POSTURE: named, **numbers_by_name(rest)}


class ScenarioPart(KeyedPart):
    """A scenario: robot, start, time, task, objective, resolver."""

    name: str = Field(
        "", description="letters, digits and _ . - only; the file's when not given", pattern=r"^\w[\w.-]*$"
    )
    title: str = Field("", description="a line that says what it shows")
    robot: RobotChoice = Field(
        description="a name, a path, or a mapping with source, or with platform and arm (or arms)"
    )
    q0: Annotated[dict[str, Any] | list[Nested], BeforeValidator(start_of)] = Field(
        description="configuration at t = 0, m and rad: a list in q's order, or by name (0 for the "
        "rest; posture: home takes one of the SRDF)"
    )
    duration: Positive = Field(description="s, above 0")
    dt: Positive = Field(0.005, description="time between samples and step of the fixed-step methods, s")
    method: Literal["rk4", "midpoint", "euler", "zoh", "zoh_midpoint", "adaptive"] = Field(
        "rk4",
        description="rk4, midpoint, euler, zoh (inputs constant over dt, as on a robot), zoh_midpoint "
        "(constant, those of the middle of dt), adaptive",
    )
    tolerance: Positive = Field(1e-9, description="local error of the adaptive method, m and rad")
    task: Annotated[TaskList, BeforeValidator(listed), Field(min_length=1)] = Field(
        description="a task, or a list of tasks done together"
    )
    objective: ObjectiveList = Field(
        default_factory=list,
        description="what to minimise with the redundancy: one, a list that is added up, or none",
    )
    resolver: AnyResolver = Field(
        description=f"how the redundancy is resolved: kind {in_words(list(RESOLVERS), 'or')}, with its keys"
    )

    order: Annotated[Literal[1, 2], BeforeValidator(integer)] = Field(
        1, description="1 for inputs u, 2 for inputs that accelerate: u_dot from t, q and u, from rest"
    )
    servo: Positive = Field(
        Controller.SERVO, description="at order 2: k with which u follows the resolver's answer, 1/s"
    )
    limits: Annotated[LimitsPart | None, BeforeValidator(part_or_none)] = Field(
        None, description="what the inputs are kept within: true for the robot's own limits, or a mapping"
    )
    collisions: Annotated[CollisionsPart | None, BeforeValidator(part_or_none)] = Field(
        None, description="distances to keep: true for the robot to itself, or a mapping with obstacles"
    )
    until: Annotated[GoalPart | None, BeforeValidator(part_or_none)] = Field(
        None, description="a target to reach: the run ends where the error is within tolerances"
    )
    disturbances: DisturbancesPart | None = Field(None, description="slip, creep, odometry, noise, delay")
    retreat: Annotated[RetreatPart | None, BeforeValidator(part_or_none)] = Field(
        None, description="true or a mapping to back off where the error stalls, and start again"
    )
    steering: Annotated[SteeringPart | None, BeforeValidator(part_or_none)] = Field(
        SteeringPart.model_validate({}),
        description="what steers a platform where neither task nor objective does: true, false, or a mapping",
    )

    scene: ScenePart | None = Field(
        None,
        description="what else is drawn, and how the page opens",
    )

    #: The keys that are sections of plugins.
    section_keys: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def known_keys(cls) -> Collection[str]:
        return schema().model_fields

    def sections(self) -> dict[str, Section]:
        """The sections of plugins that the file has, by key."""
        values = {key: getattr(self, key) for key in self.section_keys}
        return {key: section for key, section in values.items() if section is not None}

    def section(self, key: str) -> Section | None:
        return self.sections().get(key)

    @property
    def moved_by(self) -> str:
        """The section whose motion a run is, in place of the closed loop's; "" where there is none."""
        return next((key for key, section in self.sections().items() if section.moves), "")

    @property
    def searches(self) -> bool:
        """Whether making a controller takes seconds."""
        return any(section.searches and not section.moves for section in self.sections().values())

    def goal(self) -> Goal | None:
        """The target at which a closed loop ends; one that follows a plan goes on for its duration."""
        taken = any(section.takes_until for section in self.sections().values())
        return None if self.until is None or taken else self.until.make()

    def motion(self, key: str, making: Making) -> SectionMotion:
        """The motion of a section, or of the section with its defaults; `RunError` where there is none."""
        section = self.section(key)
        if section is None:
            known = section_names(ScenarioPart.model_fields)
            expect_known("section", key, known)
            kind = section_class(known[key])
            if kind is None:
                raise InputError(f"section {key} cannot be imported")
            section = kind.model_validate({})
        with about(key):
            return section.motion(making)

    def build_collisions(self, robot: Robot) -> Collisions | None:
        with at("collisions"):
            return None if self.collisions is None else self.collisions.build(robot)

    def build(
        self,
        robot: Robot,
        absolute: Absolute,
        own: Resolver | None = None,
        progress: Progress | None = None,
    ) -> Controller:
        """The controller, after a check of q0; errors know their key. `absolute` finds the files named, `own`
        is a resolver in the place of the file's, `progress` is of a plan that is followed."""
        self.check_start(robot)
        with at("task"):
            task = build_tasks(self.task, robot)
        making = Making(self, robot, absolute, progress)
        for key, section in self.sections().items():
            with about(key):
                section.check(making)
                task = section.tasks(making, task)
        with at("resolver"):
            resolver = own or self.resolver.make()
        with at("task"):
            sequenced = any(item.when for item in task)
            if sequenced:
                Sequence(Stack.of(task), robot)
            levels = Stack.of(task).levels(robot)
            s, first = sum(levels), levels[0]
            if first > robot.n_u and not sequenced and not resolver.more_rows:
                of = "" if len(levels) == 1 else " in the first level of priority"
                expected = f"at most {robot.n_u} rows{of}, as many as inputs ({few(robot.u_names)})"
                raise InputError(expected=expected, got=first)
        with at("limits"):
            limits = None if self.limits is None else self.limits.build(robot)
        collisions = self.build_collisions(robot)
        with at("objective"):
            objective = build_objective(self.objective, robot, collisions)
        with at("retreat"):
            goal = None if self.until is None else self.until.make()
            retreat = None if self.retreat is None else self.retreat.build(robot, goal)
        with at("scene"):
            if self.scene is not None:
                self.scene.build(robot)
        with at("disturbances"):
            if self.disturbances is not None:
                self.disturbances.build(robot, self.dt)
        steering = None if self.steering is None else self.steering.make()
        with at("resolver"):
            added = None
            rest = (limits, self.dt, retreat, steering or False)
            second: Any = {"order": self.order, "servo": self.servo} if self.order == 2 else {}
            if sequenced:
                return SequencedController(robot, task, resolver, objective, *rest, collisions, **second)
            if isinstance(self.resolver, WithAddedTask):
                with at("added_task"):
                    added = build_tasks(self._added_task(self.resolver), robot)
                    rows = sum(len(item.rows(robot)) for item in added)
                    law = None if steering is None else steering.on(robot, task)
                    held = 0 if law is None else len(law.inputs)
                    self._check_added(robot, rows, robot.n_u - s, held)
            with self.resolver.own_keys():
                return Controller(robot, task, resolver, objective, added, *rest, collisions, **second)

    def check_start(self, robot: Robot) -> None:
        """`KeyedError` for a q0 that is none of the robot's, or outside limits that are not kept."""
        with at("q0"):
            named = self.q0 if isinstance(self.q0, dict) else {}
            for name in named:
                with at(name):
                    robot.q({name: named[name]})
            come_back = self.limits is not None and self.limits.position is not False
            robot.check_limits(robot.q(self.q0), come_back=come_back)

    def _added_task(self, resolver: WithAddedTask) -> list[TaskPart]:
        """The task that takes up the redundancy: as given, or the objective's terms at their targets."""
        if resolver.added_task is not None:
            return resolver.added_task
        squares = [part for part in self.objective if isinstance(part, QuadraticPart) and not part.maximise]
        if len(squares) < len(self.objective):
            return []
        made = []
        for term in (term for part in squares for term in part.terms):
            target = REFERENCE_PARTS["constant"].model_validate({"kind": "constant", "value": term.target})
            keys = {"kind": "coordinates", "of": [term.of], "reference": target, "gain": resolver.gain}
            made.append(TASK_PARTS["coordinates"].model_validate(keys))
        return made

    def _check_added(self, robot: Robot, rows: int, redundancy: int, held: int) -> None:
        if rows in (redundancy, redundancy - held):
            return
        explicit = isinstance(self.resolver, WithAddedTask) and self.resolver.added_task is not None
        what = "" if explicit else f"the objective has {rows} quadratic terms"
        own = robot.following.independent.tolist()
        arm = [*own[robot.platform.n_p :], *own[: robot.platform.n_p][::-1]][:redundancy]
        q = robot.q(self.q0)
        names, values = ", ".join(robot.q_names[i] for i in arm), ", ".join(f"{q[i]:.4g}" for i in arm)
        example = f"{{kind: coordinates, of: [{names}], reference: [{values}], gain: 1}}"
        mend = Setting(("resolver", "added_task"), example)
        raise InputError(what, expected=f"{redundancy} rows", got=rows, mend=mend)

    def explicit(self) -> dict[str, Any]:
        """Every key as plain data, with what the library chooses where the file leaves it open."""
        data = self.model_dump()
        data["robot"] = self.robot.explicit()
        data["resolver"] = self.resolver.explicit()
        if isinstance(self.resolver, WithAddedTask):
            added = self._added_task(self.resolver)
            data["resolver"]["added_task"] = [part.model_dump() for part in added] or None
        for key in ("task", "objective"):
            if len(data[key]) == 1:
                data[key] = data[key][0]
        data["steering"] = data["steering"] or False
        return {key: _kind_first(value) for key, value in data.items()}


def _kind_first(value: Any) -> Any:
    """The same data with `kind` as the first key of every mapping, as people write it."""
    if isinstance(value, dict):
        ordered = sorted(value.items(), key=lambda item: item[0] != "kind")
        return {key: _kind_first(item) for key, item in ordered}
    return [_kind_first(item) for item in value] if isinstance(value, list) else value


def schema(data: Mapping[str, object] | None = None) -> type[ScenarioPart]:
    """The keys of a file with these data: nmm's, shipped plugins' and strangers' that the data have; without
    data those of all plugins."""
    core = ScenarioPart.model_fields
    shipped = section_names(core, foreign=False)
    if data is None:
        return _with_sections(tuple(section_names(core).items()))
    if all(key in core or key in shipped for key in data):
        return _with_sections(tuple(shipped.items()))
    every = section_names(core)
    return _with_sections(tuple((key, every[key]) for key in every if key in shipped or key in data))


@cache
def _with_sections(names: tuple[tuple[str, Addition], ...]) -> type[ScenarioPart]:
    kinds = {key: kind for key, addition in names if (kind := section_class(addition)) is not None}
    parts: dict[str, Any] = {
        key: (
            Annotated[kind | None, BeforeValidator(part_or_none)],
            Field(None, description=kind.summary),
        )
        for key, kind in kinds.items()
    }
    whole = create_model("ScenarioPart", __base__=ScenarioPart, __doc__=ScenarioPart.__doc__, **parts)
    whole.section_keys = tuple(kinds)
    order = list(ScenarioPart.model_fields)
    for key, kind in kinds.items():
        order.insert(order.index(kind.after) + 1 if kind.after in order else len(order), key)
    fields = {key: whole.model_fields[key] for key in order}
    whole.model_fields.clear()  # not yet in use: its schema is built when it first reads a file
    whole.model_fields.update(fields)
    return whole
