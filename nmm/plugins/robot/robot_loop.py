"""A robot's loop that may fail: what it is given is looked at, and what goes wrong ends in a stop along the
limits. Time comes from outside, so that a test can be any clock."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, scalar
from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.motion.trajectory import Trajectory
from nmm.plugins.robot.loop_clock import LoopClock
from nmm.plugins.robot.loop_inputs import LoopInputs
from nmm.plugins.robot.loop_log import LoopFindings, LoopLog
from nmm.plugins.robot.loop_state import LoopState
from nmm.plugins.robot.loop_watch import LoopWatch
from nmm.plugins.robot.measured_state import MeasuredState, Tolerances
from nmm.plugins.robot.pace import keep_pace
from nmm.plugins.robot.pose_filter import PoseFilter

_STOPS = LoopState.STOPPING, LoopState.STOPPED
_MOVING = LoopState.STARTING, LoopState.RUNNING, LoopState.HOLDING


class Loop:
    """A controller in a robot's loop: u = loop.step(now, q, measured_at), once a period.

    It does no input or output, and asks no clock: `step` gets both. What cannot be a measurement is refused;
    meanwhile the robot is believed to move as its inputs say. `watchdog` after the last one that was used the
    loop stops, along the limits, and stays so until `resume`. Nothing that `step` is given raises.

    Parameters
    ----------
    controller : what limits it has, a stop keeps; at order 2 u is what accelerations lead to in a period
    period : s, between two calls; the controller's dt unless given, and then that, too
    watchdog : s, from the time of the last measurement used until the loop stops, and from one call to the
        next
    hold : s, for which inputs are held, within limits, where the resolver has no answer; then it stops
    soft_start : s, in which inputs rise from 0 to what the controller wants; 0 for none
    lag : s, by which the robot may follow its inputs late
    jump : m and rad; a measurement may be off by that, and by the way that the inputs asked for since the one
        before; what is farther off is a jump
    confirm : so many measurements in a row that agree with each other after a jump of the platform, and the
        localisation is believed; None for never
    slip : shares of the way that the inputs asked for in the last second by which the platform and the joints
        may have moved less or more; beyond them, and what `jump` and `lag` allow, measurements contradict the
        inputs, as old ones with new times do, and the loop stops. None for any
    outside : share of the range between its limits (the file's, where these are wider than the controller's)
        by which a joint may be measured beyond them; farther out it is in another unit, or not homed, and the
        loop does not start, or stops. None for any
    error : m and rad, norms of the task error beyond which a loop that runs stops; None for any
    keep : samples that `trajectory` has, the last ones

    Attributes
    ----------
    state : what it does
    refused : how many measurements were not used, by reason

    Raises
    ------
    InputError : no period; numbers that are not above 0

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> limits = nmm.Limits({"v": 0.5, "omega": 1.0}, acceleration=5.0)
    >>> loop = nmm.Loop(nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits), period=0.01)
    >>> q = robot.q({"q2": 0.5})
    >>> for k in range(200):
    ...     u = loop.step(0.01 * k, q)
    ...     q = q + 0.01 * robot.S(q) @ u
    >>> loop.state, loop.findings
    (<LoopState.RUNNING: 'running'>, ())
    >>> for k in range(200, 240):  # no measurements any more
    ...     u = loop.step(0.01 * k)
    >>> str(loop.state), [one.code for one in loop.findings], float(abs(u).max())
    ('stopped', ['measurements_ended', 'stopped'], 0.0)
    """

    def __init__(
        self,
        controller: Controller,
        period: float | None = None,
        *,
        watchdog: float = 0.1,
        hold: float = 0.05,
        soft_start: float = 0.5,
        lag: float = 0.05,
        jump: tuple[float, float] = (0.05, 0.1),
        confirm: int | None = 5,
        slip: tuple[float, float] | None = (0.5, 0.1),
        outside: float | None = 0.05,
        error: tuple[float, float] | None = None,
        keep: int = 10_000,
    ) -> None:
        period = controller.dt if period is None else period
        if period is None:
            raise InputError(where="period", expected="a number, s, or a controller with dt", got=None)
        self.controller = controller
        self.period = positive(period, "period")
        self.watchdog = positive(watchdog, "watchdog")
        self.hold = scalar(hold, "hold", least=0.0)
        self.soft_start = scalar(soft_start, "soft_start", least=0.0)
        off = positive(jump[0], "jump"), positive(jump[1], "jump")
        shares = (
            None if slip is None else (scalar(slip[0], "slip", least=0.0), scalar(slip[1], "slip", least=0.0))
        )
        tolerances = Tolerances(self.watchdog, scalar(lag, "lag", least=0.0), *off, confirm, shares)
        controller.dt = self.period
        controller.solver.load_stop()
        self._measured = MeasuredState(controller.robot, tolerances, self.period)
        self._found = LoopFindings(2.5 * self.period)
        self._watch = LoopWatch(controller, self._found, outside, error)
        self._clock = LoopClock(self.period, self.watchdog, self._found)
        self._inputs = LoopInputs(controller, self.period)
        self._log = LoopLog(controller, int(positive(keep, "keep")))
        self.state = LoopState.WAITING
        self.refused = self._watch.refused
        self._since = self._silent_since = 0.0
        self._why = ""

    @property
    def t(self) -> float:
        """The controller's clock, s since the first call; jumps of the clock are left out."""
        return self._clock.t

    @property
    def u(self) -> Array:
        """(m,) the last inputs."""
        return self._inputs.u

    @property
    def calls(self) -> int:
        """How many there were."""
        return self._clock.calls

    @property
    def late_calls(self) -> int:
        """How many came more than half a period late."""
        return self._clock.late_calls

    @property
    def q(self) -> Array:
        """(n,) where the robot is believed to be."""
        return self._measured.q.copy()

    @property
    def q_odom(self) -> Array:
        """(n,) the same with the platform in odom, where the fixes of a `PoseFilter` move nothing; q itself
        where measurements come from no such filter."""
        return self._measured.q_odom

    @property
    def corrected(self) -> bool:
        """Whether measurements come from a `PoseFilter`, q then being in its map."""
        return self._measured.corrected

    @property
    def age(self) -> float:
        """Time since the last measurement that was used, s; infinite before the first."""
        return self.t - self._measured.at

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, the last 200 (codes: docs/api/findings.md); `where` has t, values `samples` and
        `end`."""
        return self._found.as_findings()

    def trajectory(self) -> Trajectory:
        """The last samples, as the loop saw them, with its findings; `RunError` before the first."""
        return self._log.trajectory(self.period, self.findings)

    def time_of(self, stamp: float) -> float:
        """A time of the clock of `step` on the controller's clock, as for `LiveTarget.set`."""
        return self._clock.time_of(stamp)

    def stop(self, why: str = "asked") -> None:
        """Stop along the limits from the next call on."""
        if self.state not in _STOPS:
            self._found.add("stop_asked", self.t, why=why)
            self._begin_stop("stop_asked")
        if self._measured.at == -math.inf:  # it has not moved yet
            self._enter(LoopState.STOPPED)

    def resume(self) -> None:
        """Go on after a stop, from the next measurement on, which may be anywhere; `InputError` unless the
        robot stands."""
        if self.state is not LoopState.STOPPED:
            raise InputError("is not at rest", where="loop", expected="stopped", got=str(self.state))
        self._measured.forget()
        self._enter(LoopState.WAITING)

    def expect_jump(self) -> None:
        """The localisation is set anew: the next measurement is used wherever it is, and it starts softly."""
        self._measured.expect_jump()
        self._start_again()

    def _start_again(self) -> None:
        if self.state in (LoopState.RUNNING, LoopState.HOLDING):
            self._enter(LoopState.STARTING)

    def step(
        self, now: float, q: ArrayLike | PoseFilter | None = None, measured_at: float | None = None
    ) -> Array:
        """The inputs u (m,) until the next call.

        Parameters
        ----------
        now : s, of any clock
        q : (n,) measured, None where there is no measurement since the last call; or a `PoseFilter` that has
            it: what its fixes move is no jump, and where it is more than `jump`, the robot starts softly
        measured_at : s, when, of the same clock; now, or the filter's time, unless given
        """
        before = self.t
        if silence := self._clock.tell(now):
            self._measured.expect_jump()  # nobody knows what the robot did meanwhile
            if self.state not in (LoopState.WAITING, LoopState.STOPPED):
                self._found.add("not_called", self.t, gap=silence)
                self._begin_stop("not_called")
        self._measured.move_on(before, self.t)
        corrected = None
        if isinstance(q, PoseFilter):
            corrected = self._measured.move_frame(q.map_to_odom)
            measured_at = q.t if measured_at is None else measured_at
            q = q.q
        at = self.t if measured_at is None else self.time_of(measured_at)
        refused, jump = self._measured.take(self.t, q, at)
        jump = jump or corrected
        self._watch.look_at_measurement(self.t, refused, jump)
        if jump is not None:
            self._start_again()
        if refused is None and self.state not in _STOPS and self._watch.is_outside(self.t, self._measured.q):
            if self.state is LoopState.WAITING:
                self._measured.forget()
            else:
                self._begin_stop("outside_limits")
        if refused is None and self.state in _MOVING and self._watch.contradicts(self.t, self._measured):
            self._begin_stop("not_following")
        if self._measured.at == -math.inf:
            return self.u.copy()
        if self.state is LoopState.WAITING:
            self.controller.reset()
            self._enter(LoopState.STARTING)
        elif self.state not in _STOPS and self.age > self.watchdog:
            self._found.add("measurements_ended", self.t, silent=self.age)
            self._begin_stop("measurements_ended")
        self._answer()
        self._log.add(self.t, self._measured.q)
        self._measured.history.give(self.t, self.u, self.controller.solver.step_memory.q_dot)
        return self.u.copy()

    def _answer(self) -> None:
        """Inputs for where the robot is believed to be."""
        t, q, inputs = self.t, self._measured.q, self._inputs
        if self.state in _MOVING:
            if raised := inputs.compute(t, q):
                self._do_without(raised)
            else:
                self._go_on()
        if self.state is LoopState.HOLDING:
            inputs.hold(t, q)
        elif self.state in _STOPS:
            inputs.brake(t, q)
            if self.state is LoopState.STOPPED:
                inputs.rest(q)
            elif not inputs.u.any():
                self._found.add("stopped", t, why=self._why, lasted=t - self._since)
                self._enter(LoopState.STOPPED)

    def _do_without(self, why: str) -> None:
        """The resolver has no answer: hold, then stop."""
        if self.state is not LoopState.HOLDING:
            self._silent_since = self.t
            self._enter(LoopState.HOLDING)
        self._found.add("resolver_silent", self.t, why=why)
        if self.t - self._silent_since >= self.hold - 1e-9:
            self._begin_stop("resolver_silent")

    def _go_on(self) -> None:
        """The resolver has an answer: less of it where the robot has just started; a stop off the task."""
        starting, since = self.state is LoopState.STARTING, self.t - self._since
        if self.state is LoopState.HOLDING or (starting and since >= self.soft_start):
            self._enter(LoopState.RUNNING)
        elif starting:
            self._inputs.soften(self.t, self._measured.q, since / self.soft_start)
        running = self.state is LoopState.RUNNING
        self._watch.look_for_blocking(self.t, running)
        if running and self._watch.is_off_task(self.t):
            self._begin_stop("off_task")

    def _enter(self, state: LoopState) -> None:
        self.state, self._since = state, self.t

    def _begin_stop(self, why: str) -> None:
        self._why = why
        self._enter(LoopState.STOPPING)

    def run(
        self,
        read: Callable[[], tuple[ArrayLike, float] | PoseFilter | None],
        write: Callable[[Array], object],
        *,
        each: Callable[[Loop], object] | None = None,
        duration: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] = time.sleep,
    ) -> None:
        """Keep the pace until the robot has stopped: each period read, `step`, write, at times that are
        multiples of the period after the first; those that have passed are left out.

        Ctrl-C, an error of `read`, `write` or `each`, and the end of `duration` first stop the robot along
        the limits; the first error is then raised. `write` is called on meanwhile, even where it has raised,
        and with zeros at the end for as long again as the stop took, until these are sent.

        Parameters
        ----------
        read : gives a measurement (q, time of the clock), or a `PoseFilter`, or None
        write : sends u (m,) to the drives, which hold it
        each : called with the loop after each write, for what is done beside: targets, `stop`
        duration : s
        clock, sleep : others, as where measurements are stamped by another clock, and for tests
        """
        keep_pace(self, read, write, each, duration, clock, sleep)
