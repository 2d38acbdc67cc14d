"""Plants: where a robot goes with the inputs that a controller asks for, and what the controller sees of it.

The ideal plant does what it is told, and is seen as it is. A disturbed one has noise, odometry in place of q,
delay, slip and creep (`nmm.Disturbances`); its inputs are held. Both run compiled, in `motion.compiled_loop`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect
from nmm.base.kernels.compiled import checked_by_caller, compiled, scratch, view
from nmm.base.kernels.record_layout import Matrix, Vector, record_type, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.base.text_format import listed
from nmm.control.functions.program import BESIDE, LaidOut, run_program
from nmm.control.integrators import (
    STEPPING,
    Accelerated,
    Around,
    Inputs,
    Integrator,
    Velocity,
    integrator,
)
from nmm.control.limits.limits import Limits
from nmm.control.step.equations import ControlStep, write_equation
from nmm.control.step.safety_filter import SafetyFilter
from nmm.control.step.step_solver import StepSolver
from nmm.model.robots.robot import Robot
from nmm.model.robots.zero_order_hold import HeldInputs, hold_rates, inputs_of
from nmm.model.robots.zero_order_hold import Inputs as HeldRecord


class PlantController(Protocol):
    """What of `nmm.Controller` a plant needs."""

    dt: float | None

    @property
    def robot(self) -> Robot: ...
    @property
    def solver(self) -> StepSolver: ...
    @property
    def limits(self) -> Limits | None: ...

    def __call__(self, t: float, q: ArrayLike, u: ArrayLike | None = None) -> Array: ...
    def step(self, t: float, q: ArrayLike, dt: float, method: str = "rk4") -> tuple[Array, Array]: ...


class Believing(Protocol):
    """What of a filter a plant needs: where a platform is believed to be, (3,), in place of its odometry.

    begin : a run begins at q (n,)
    go_on : the platform went from q to `ahead` (n,) in dt, s, while its inputs (p,) asked for so much (`by`)
    """

    def begin(self, q: Array) -> Array: ...
    def go_on(self, q: Array, ahead: Array, by: Array, dt: float) -> Array: ...


#: Samples that a plant has room for before it makes more.
ROOM = 1024


class Disturbed(NamedTuple):
    """A run's disturbances over N samples; those of the ideal plant are empty.

    noise (N or 0, n) : added to q at each sample before the controller sees it, m and rad
    delay : samples until inputs act
    slip (m or 0,) : the share of each input that acts
    creep : s, by which a platform slides sideways, at creep v ω
    believed (N or 0, n) : what the controller takes q for, by odometry
    correct : samples after which that is put right (0: never)
    first : how many samples of the run were before
    asked (delay + N or 0, m or 2 m) : the inputs that act from each sample on, at order 2 with their rates
    """

    noise: Matrix
    delay: int
    slip: Vector
    creep: float
    believed: Matrix
    correct: int
    first: int
    asked: Matrix


_NONE = np.zeros((0, 0))
UNDISTURBED = Disturbed(_NONE, 0, np.zeros(0), 0.0, _NONE, 0, 0, _NONE)


@compiled
def slide(q: Array, share: float, ahead: Array) -> None:
    """Move `ahead` (n,), where the platform comes to from q, sideways by share times the way along it times
    the turn: creep v ω dt, with share = creep / dt."""
    turn = ahead[2] - q[2]
    middle = q[2] + 0.5 * turn
    c, s = math.cos(middle), math.sin(middle)
    aside = share * turn * (c * (ahead[0] - q[0]) + s * (ahead[1] - q[1]))
    ahead[0] -= s * aside
    ahead[1] += c * aside


MOVE = void(
    *(record_type(HeldRecord), int64, int64, float64, float64[::1]),
    *(record_type(Disturbed), float64[::1]),
)


@compiled
def move(
    inputs: HeldRecord, rated: int, k: int, dt: float, q: Array, disturbed: Disturbed, ahead: Array
) -> None:
    """ahead (n,): q after dt, from sample k, with what was asked for until then; `rated` (m or 0): how many
    rates act. Odometry counts what the wheels turn, of which slip and creep are no part; encoders of the
    arm's joints see these where they are."""
    m, columns, n, n_p = disturbed.slip.shape[0], disturbed.asked.shape[1], q.shape[0], inputs.coordinates
    turned = view(disturbed.asked, k * columns, (m,))
    turned_rates = view(disturbed.asked, k * columns + m, (rated,))
    acting, rates = scratch(m), scratch(rated)
    for j in range(m):
        acting[j] = disturbed.slip[j] * turned[j]
    for j in range(rated):
        rates[j] = disturbed.slip[j] * turned_rates[j]
    hold_rates(inputs, q, acting, rates, dt, ahead)
    if disturbed.creep != 0.0:
        slide(q, disturbed.creep / dt, ahead)
    if disturbed.believed.shape[0] > 0:
        after = view(disturbed.believed, (k + 1) * n, (n,))
        hold_rates(inputs, view(disturbed.believed, k * n, (n,)), turned, turned_rates, dt, after)
        right = disturbed.correct > 0 and (disturbed.first + k + 1) % disturbed.correct == 0
        for i in range(0 if right else n_p, n):
            after[i] = ahead[i]


ACT = void(
    *(int64, float64, float64[::1], int64[::1], float64[::1]),
    *(record_type(Disturbed), float64[::1]),
)


@compiled
def act(
    k: int, dt: float, q: Array, integers: Integers, floats: Array, disturbed: Disturbed, ahead: Array
) -> None:
    """`move` from sample k, which a controller has just made; at order 2 its inputs go on."""
    laid = views(LaidOut, integers, floats, 0)
    e = views(ControlStep, integers, floats, BESIDE)
    m, u_dot, asked, row = disturbed.slip.shape[0], e.second.u_dot, disturbed.asked, k + disturbed.delay
    rated, n_p = u_dot.shape[0], laid.buffers.G.shape[0]
    for j in range(m):
        asked[row, j] = e.problem.before[j] if rated > 0 else e.answer.u[j]
    for j in range(rated):
        asked[row, m + j] = u_dot[j]
        e.problem.before[j] += dt * u_dot[j]
    inputs = HeldRecord(laid.platform_kernel, laid.platform_numbers, n_p, e.arm.moved, e.arm.mimic_joints)
    move(inputs, rated, k, dt, q, disturbed, ahead)


OBSERVE = void(float64, float64[::1], int64[::1], float64[::1])


@compiled
def observe(t: float, q: Array, integers: Integers, floats: Array) -> None:
    """The task where the robot is, q, in place of where the sample just made has it."""
    laid = views(LaidOut, integers, floats, 0)
    e = views(ControlStep, integers, floats, BESIDE)
    stands = laid.stands[()]
    laid.stands[()] = 1
    run_program(t, q, integers, floats)
    laid.stands[()] = stands
    write_equation(e.task, laid.buffers, e.arm, e.problem.J, e.problem.rate)
    for i in range(e.second.lead.shape[0]):
        e.task.full[i] += e.second.lead[i]


@dataclass(frozen=True)
class Guarded(Around):
    """Holds the inputs where anything is near: the safety filter checks the path that held inputs make."""

    safety_filter: SafetyFilter
    held: HeldInputs

    def inputs(self, stage: Inputs, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        """Other inputs than the sample's are not checked: they are taken where nothing is near."""
        if self.safety_filter.held:
            return u
        inputs = self.integrator.inputs(stage, t, q, q_dot, u, dt)
        near = inputs is not u and not self.safety_filter.clear(np.abs(self.held(q, inputs, dt) - q).sum())
        return u if near else inputs

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        if not self.safety_filter.held:
            ahead = self.integrator.advance(velocity, t, q, q_dot, u, dt)
            if self.safety_filter.clear(float(np.abs(ahead - q).sum())):
                return ahead
        return self.held(q, u, dt)


def guarded(advance: Integrator, controller: PlantController) -> Integrator:
    safety_filter = controller.solver.safety_filter
    return advance if safety_filter is None else Guarded(advance, safety_filter, HeldInputs(controller.robot))


def method_for(controllers: Sequence[PlantController], method: str, tolerance: float = 1e-9) -> Integrator:
    """The integrator of that name; `InputError` for one that does not go with one of the controllers."""
    chosen = integrator(method, controllers[0].robot, tolerance)
    if method == "adaptive" and any(each.solver.samples for each in controllers):
        raise InputError(
            "limits, distances, a retreat and a step by Armijo's rule are kept from sample to sample",
            where="method",
            expected=listed(STEPPING, "or"),
            got=method,
        )
    for each in controllers:
        if each.solver.second and (method == "zoh_midpoint" or (each.limits is not None and method != "zoh")):
            raise InputError(
                "at order 2 what is held over a sample, and limits hold for, is its u_dot",
                where="method",
                expected="zoh",
                got=method,
            )
    return chosen


@dataclass(eq=False)
class Plant:
    """What a controller's loop moves: by default the ideal robot, which goes where an integrator says.

    Attributes
    ----------
    integrator : between two samples; inputs that are held are a disturbed robot's
    disturbed : what it does otherwise than it is told
    longer : makes disturbances of more samples, whose first ones are the same; for `step`
    samples : how many `step` has made
    believing : what has the platform elsewhere than odometry has it; such a run is not compiled as a whole

    Examples
    --------
    >>> plant = nmm.Disturbances(slip={"v": 0.9}).plant(nmm.load("unicycle_2r"), dt=0.01)
    >>> isinstance(plant, nmm.extending.Plant), plant.disturbs, plant.misleads
    (True, True, False)
    """

    integrator: Integrator
    disturbed: Disturbed = UNDISTURBED
    longer: Callable[[int], Disturbed] | None = None
    samples: int = 0
    believing: Believing | None = None

    @property
    def disturbs(self) -> bool:
        """Whether the robot does otherwise than it is told; its steps are not taken again."""
        return len(self.disturbed.slip) > 0

    @property
    def misleads(self) -> bool:
        """Whether a controller sees another q than the robot's."""
        return len(self.disturbed.noise) > 0 or len(self.disturbed.believed) > 0

    @property
    def believed(self) -> Array | None:
        """What the controller takes q for by odometry or a filter, (N, n); None where it is told."""
        return self.disturbed.believed if len(self.disturbed.believed) else None

    def later(self, first: int) -> Plant:
        """The same robot from the sample `first` on."""
        d = self.disturbed
        arrays = {name: getattr(d, name)[first:] for name in ("noise", "believed", "asked")}
        return replace(self, disturbed=d._replace(first=d.first + first, **arrays))

    def begin(self, q: Array) -> None:
        """A run begins at q (n,)."""
        if len(self.disturbed.believed):
            self.disturbed.believed[0] = q
        if self.believing is not None:
            self.disturbed.believed[0, :3] = self.believing.begin(q)

    def _believe(self, k: int, q: Array, ahead: Array, dt: float) -> None:
        """What is believed at sample k + 1, after the inputs that acted from sample k on."""
        if self.believing is not None:
            m = len(self.disturbed.slip)
            u, u_dot = self.disturbed.asked[k, :m], self.disturbed.asked[k, m:]
            by = dt * u + 0.5 * dt * dt * u_dot
            self.disturbed.believed[k + 1, :3] = self.believing.go_on(q, ahead, by, dt)

    def seen(self, k: int | slice, q: Array) -> Array:
        """q (n,) or (K, n) at those samples, as the controller sees it."""
        d = self.disturbed
        q = d.believed[k] if len(d.believed) else q
        return q + d.noise[k] if len(d.noise) else q

    def under(self, controller: PlantController) -> Integrator:
        """The ideal robot under a controller: inputs are held near obstacles, and accelerate at order 2."""
        solver = controller.solver
        if solver.second:
            robot, u_dot = controller.robot, solver.step_memory.second.u_dot
            return Accelerated(self.integrator, robot, solver.before, u_dot)
        return guarded(self.integrator, controller)

    def act(self, solver: StepSolver, k: int, q: Array, dt: float) -> Array:
        """Where the disturbed robot comes to from q in dt, s, with what was asked for until sample k."""
        ahead = np.empty_like(q)
        checked_by_caller(act, ACT)(k, dt, q, *solver.blocks, self.disturbed, ahead)
        self._believe(k, q, ahead, dt)
        return ahead

    def move(self, robot: Robot, k: int, q: Array, u: Array, u_dot: Array, dt: float) -> Array:
        """`act` of inputs u (m,), per s, and their rates u_dot (m,), asked for at sample k."""
        ahead, row, m = np.empty_like(q), k + self.disturbed.delay, len(u)
        self.disturbed.asked[row, :m], self.disturbed.asked[row, m:] = u, u_dot
        checked_by_caller(move, MOVE)(inputs_of(robot), m, k, dt, q, self.disturbed, ahead)
        return ahead

    def observe(self, solver: StepSolver, t: float, q: Array) -> None:
        """Where a controller is misled, the task of the sample just made becomes that where the robot is."""
        if self.misleads:
            solver.program.prepare(t, q)
            checked_by_caller(observe, OBSERVE)(t, q, *solver.blocks)

    def see(self, q: Array) -> Array:
        """q (n,) as the controller sees it at the next sample, of runs that are as long as they get."""
        k = self.samples
        if self.longer is not None and k + 1 >= len(self.disturbed.asked) - self.disturbed.delay:
            before, self.disturbed = self.disturbed, self.longer(max(ROOM, 2 * k))
            for name in ("believed", "asked"):
                getattr(self.disturbed, name)[: len(getattr(before, name))] = getattr(before, name)
        if k == 0:
            self.begin(q)
        return self.seen(k, q)

    def go_on(self, robot: Robot, q: Array, u: Array, u_dot: Array, times: Array) -> Array:
        """q (K, n) at times (K,), s, after the sample at q, with inputs u (m,) and rates u_dot (m,) from it
        on; the next sample is at the last of them."""
        ahead = [self.move(robot, self.samples, q, u, u_dot, float(dt)) for dt in times]
        self._believe(self.samples, q, ahead[-1], float(times[-1]))
        self.samples += 1
        return np.array(ahead)

    def step(
        self, controller: PlantController, t: float, q: Array, dt: float, method: str
    ) -> tuple[Array, Array]:
        """`Controller.step` of this robot."""
        expect(method == "zoh", "method", "zoh, as a plant's inputs are held", method)
        if not self.disturbs:
            return controller.step(t, q, dt, method)
        if controller.solver.samples and dt != controller.dt:
            controller.dt = dt
        answer = controller(t, self.see(q))
        solver = controller.solver
        u = solver.before.copy() if solver.second else answer
        q_next = self.act(solver, self.samples, q, dt)
        self.samples += 1
        return q_next, u
