"""Where a platform is by its wheels, a gyro and fixes of its pose, with what is not known of it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, counted, matrix, positive, scalar, vector
from nmm.base.errors import InputError, expect, expect_kind
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import views
from nmm.model.robots.robot import Robot
from nmm.plugins.robot import filter_history as rings
from nmm.plugins.robot.filter_checks import covariance_of, float_array, gates_of, noise_of, turned_axes
from nmm.plugins.robot.odometry import Odometry

#: What became of a fix, by the codes of `filter_history`.
OUTCOMES = ("waiting", "used", "outlier", "late", "early", "crowded")
_POSES = (2,), (3,)
#: No gyro turns faster, rad/s: a rate in degrees may.
FASTEST_TURN = 100.0
#: So much is remembered at most: readings and fixes.
MOST_STEPS, MOST_FIXES = 1_000_000, 10_000


class PoseFilter:
    """Where a platform is by its wheels' encoders, a gyro and fixes of its pose: an invariant Kalman filter
    on SE(2), the gyro's bias and, if wanted, a scale of each counter.

    Motion is that of `Odometry`, for every platform; noise is of what wheels turn, of slip, and of the gyro.
    A fix may come late and out of order: it is taken where its time belongs, and what came after it again. It
    waits for encoders that have not reached its time.

    The error is the left-invariant one, T = T_believed exp(eps), along the body's axes. How it goes on, and
    what fixes in the world say of it, depends on no heading that is believed: the filter is consistent even
    where fixes are positions alone and the heading is hardly known at first; one in (x, y, theta) is not.

    Frames are as in REP-105: `odom` goes on without jumps; fixes change `map_to_odom`.

    Parameters
    ----------
    robot : with a platform that moves
    q (n,) : where it stands at first, m and rad
    encoders : readings there, by name, as for `Robot.odometry`
    t : their time, s
    covariance (3, 3) : of x, y, theta at first, in the world's axes
    spread : variance of a counter's turning for each radian (metre) that it counts, rad²/rad: a number, or by
        name
    slip_noise : standard deviations of what the platform slips: along and across, m for the root of each m of
        way, and in heading, rad for the root of each rad of turn
    slip : the share of a wheel's turning that moves the platform: a number, or by name
    gyro_noise : density of the yaw rate's noise, rad/s/√Hz; None without a gyro
    bias_deviation, bias_walk : the gyro's bias at first is zero to so much, rad/s, and walks by so much,
        rad/s for the root of each s
    scale_deviation, scale_walk : likewise of each counter's scale, a share of its turning, and 1/√s: a tyre
        that loses air. With 0 and 0 the scales are no part of the state
    turn_deviation, turn_walk : likewise of a scale of all turns, the file's track (or wheelbase) over what it
        is: a skid-steer's depends on the ground
    delay : fixes may come so late, s
    rate : readings a second, at most; with more, fixes may come less late
    fixes : how many of the last `delay` are remembered
    gate : the share of fixes that should pass, were all as they say; those beyond are outliers, and change
        nothing. None: all pass
    fastest, wrapped : as for `Robot.odometry`

    Raises
    ------
    InputError : what `Robot.odometry` refuses; matrices that are no covariances; numbers out of range; more
        to remember than a million readings or 10,000 fixes

    Source: A. Barrau, S. Bonnabel, The invariant extended Kalman filter as a stable observer, IEEE Trans.
    Automatic Control 62(4), 2017.

    Examples
    --------
    >>> robot = nmm.load("differential_base")
    >>> still = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
    >>> known = np.diag([0.01, 0.01, 0.25])  # the heading to half a radian
    >>> pose_filter = nmm.PoseFilter(robot, robot.rest, still, 0.0, covariance=known, spread=1e-4)
    >>> for k in range(1, 101):  # 1 m in 1 s
    ...     q = pose_filter.update({name: 0.1 * k for name in still}, 0.01 * k)
    >>> pose_filter.fix([0.8, 0.6], np.diag([1e-4, 1e-4]), t=1.0)  # it went to the left
    'used'
    >>> pose_filter.pose.round(2), pose_filter.odom.round(2)
    (array([0.8 , 0.6 , 0.62]), array([1., 0., 0.]))
    """

    def __init__(
        self,
        robot: Robot,
        q: ArrayLike,
        encoders: Mapping[str, float],
        t: float,
        *,
        covariance: ArrayLike,
        spread: float | Mapping[str, float],
        slip_noise: ArrayLike = (0.0, 0.0, 0.0),
        slip: float | Mapping[str, float] = 1.0,
        gyro_noise: float | None = None,
        bias_deviation: float = 0.0,
        bias_walk: float = 0.0,
        scale_deviation: float = 0.0,
        scale_walk: float = 0.0,
        turn_deviation: float = 0.0,
        turn_walk: float = 0.0,
        delay: float = 0.5,
        rate: float = 200.0,
        fixes: int = 64,
        gate: float | None = 0.999,
        fastest: float | Mapping[str, float] | None = None,
        wrapped: bool | Collection[str] | None = None,
    ) -> None:
        expect_kind(robot, Robot, "PoseFilter: robot", "a Robot, as nmm.load gives it")
        self._where = where = f"PoseFilter: {robot.name}"
        self.robot = robot
        t = scalar(t, f"{where}: t")
        self._odometry = Odometry(robot, q, encoders, slip, fastest=fastest, wrapped=wrapped, t=t)
        self.counters = self._odometry.counters
        self._has_gyro = gyro_noise is not None
        walking = {
            "bias": (bias_deviation, bias_walk),
            "scale": (scale_deviation, scale_walk),
            "turn": (turn_deviation, turn_walk),
        }
        noise, P = noise_of(self._odometry, where, spread, slip_noise, gyro_noise, walking)
        seconds, rate = positive(delay, f"{where}: delay"), positive(rate, f"{where}: rate")
        if (remembered := seconds * rate) > MOST_STEPS:
            what = f"{remembered:.3g} readings would be remembered"
            raise InputError(what, where=f"{where}: delay, rate", expected=f"at most {MOST_STEPS:,}")
        steps = math.ceil(remembered) + 2
        places = counted(fixes, f"{where}: fixes")
        expect(places <= MOST_FIXES, f"{where}: fixes", f"at most {MOST_FIXES:,}", places)
        gates = np.full(2, np.inf)
        if gate is not None:
            gates[:] = gates_of(scalar(gate, f"{where}: gate", above=0.0, below=1.0))
        self._joints = self._odometry.q
        sizes = steps, places, len(P)
        self._blocks = rings.new_history(
            self._odometry.record, noise, gates, seconds, sizes, self._joints[:3]
        )
        self._history = views(rings.History, *self._blocks, 0)
        self._advance = checked_by_caller(rings.advance, rings.ADVANCE)
        self._add_fix = checked_by_caller(rings.add_fix, rings.ADD_FIX)
        self._still = np.zeros(len(self.counters))
        self._start(t, self._joints[:3], covariance, np.zeros(len(P)), P)

    def _start(self, t: float, pose: ArrayLike, covariance: ArrayLike, x: Array, P: Array) -> None:
        """Begin at t with a pose (3,), of covariance (3, 3), and else with x (d,) and P (d, d)."""
        steps = self._history.steps
        x[:3] = vector(pose, 3, f"{self._where}: pose")
        turn = turned_axes(x[2])
        P[:3] = P[:, :3] = 0.0
        P[:3, :3] = turn.T @ covariance_of(covariance, f"{self._where}: covariance") @ turn
        steps.end[0], steps.ahead[0] = np.nextafter(t, -np.inf), self._joints[3 : self.robot.platform.n_p]
        steps.x[0], steps.P[0] = x, P
        self._history.newest[()], self._history.stored[()] = 0, 1
        self._history.fixed[()] = self._history.outliers[()] = 0
        self.step(t, self._still)  # fixes of this time count from here on

    def update(self, encoders: Mapping[str, float], t: float, yaw_rate: float | None = None) -> Array:
        """q (n,) at these readings, rad or m: the pose in the map, and the joints.

        Parameters
        ----------
        encoders : as for `Odometry.update`
        t : when they were read, s, later than before
        yaw_rate : mean of the gyro since then, rad/s, about z, within ±100; None where there is none

        Raises
        ------
        InputError : as of `Odometry.update`, and of `step`; nothing is changed then
        """
        t, yaw_rate = self._check_step(t, yaw_rate)
        self._joints = self._odometry.update(encoders, t)
        self._take(t, self._odometry.last_counts, self._joints[3 : self.robot.platform.n_p], yaw_rate)
        return self.q

    def step(
        self, t: float, by: ArrayLike, own: ArrayLike | None = None, yaw_rate: float | None = None
    ) -> None:
        """The same without names, for fast loops: how far the counters went, (k,) in the order of `counters`,
        rad or m, and where the platform's own joints are now, (n_p - 3,), where they were by default.

        Raises
        ------
        InputError : t is not later than before, other lengths, numbers that are not finite; nothing is
            changed then
        """
        t, yaw_rate = self._check_step(t, yaw_rate)
        steps = self._history.steps
        own = steps.ahead[self._history.newest[()]] if own is None else own
        counts, joints = float_array(by), float_array(own)
        if counts.shape != self._still.shape or joints.shape != steps.ahead[0].shape:
            expected = f"{self._still.size} counters and {steps.ahead.shape[1]} joints"
            raise InputError(where=f"{self._where}: step", expected=expected, got=(by, own))
        self._take(t, counts, joints, yaw_rate)

    def _check_step(self, t: float, yaw_rate: float | None) -> tuple[float, float]:
        """Both as numbers, NaN for no yaw rate."""
        if not isinstance(t, float):
            t = scalar(t, f"{self._where}: t")
        if not self.t < t < math.inf:
            raise InputError(where=f"{self._where}: t", expected=f"a time after {self.t:g} s", got=t)
        if yaw_rate is None:
            return t, math.nan
        where = f"{self._where}: yaw_rate"
        if not self._has_gyro:
            raise InputError(where=where, expected="a filter with gyro_noise", got=yaw_rate)
        return t, scalar(yaw_rate, where, least=-FASTEST_TURN, most=FASTEST_TURN)

    def _take(self, t: float, by: Array, joints: Array, yaw_rate: float) -> None:
        if not self._advance(*self._blocks, t, by, joints, yaw_rate):
            expected = "finite numbers, of counters that determine the inputs"
            raise InputError(where=f"{self._where}: step", expected=expected, got=(by, joints))

    def fix(self, pose: ArrayLike, covariance: ArrayLike, t: float, at: ArrayLike = (0.0, 0.0)) -> str:
        """Take a fix in the map: x, y, theta or x, y alone, m and rad.

        Parameters
        ----------
        pose : (3,) or (2,); theta by full turns as it comes
        covariance : (3, 3) or (2, 2), positive definite, in the map's axes
        t : when it was so, s
        at (2,) : the point of the platform whose x and y these are, in its own axes, m: an antenna

        Returns
        -------
        str : "used"; "outlier", beyond the gate; "waiting" for encoders of its time; "late" or "early" by
            more than `delay`, "crowded" where `fixes` are remembered: these three are not used

        Raises
        ------
        InputError : other shapes, numbers that are not finite, a matrix that is no covariance
        """
        y, R, lever = map(float_array, (pose, covariance, at))
        where = f"{self._where}: fix"
        shaped = y.shape in _POSES and R.shape == (y.size, y.size) and lever.shape == (2,)
        if not (shaped and isinstance(t, float)):
            y, lever, t = vector(pose, (2, 3), where), vector(at, 2, f"{where}: at"), scalar(t, f"{where}: t")
            R = matrix(covariance, (y.size, y.size), f"{where}: covariance")
        code = self._add_fix(*self._blocks, t, y, R, lever)
        if code == rings.INVALID:
            for name, value in (("", y), (": covariance", R), (": at", lever), (": t", t)):
                array(value, where + name)
            expected = "a symmetric matrix, positive definite"
            raise InputError(where=f"{where}: covariance", expected=expected, got=R)
        return OUTCOMES[code]

    def restart(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Put the platform at a pose (3,), m and rad, with its covariance (3, 3): it was carried away, or all
        fixes are outliers. What came before is forgotten, but for bias and scales; `odom` goes on."""
        later = float(np.nextafter(self.t, np.inf))
        self._start(later, pose, covariance, self._x.copy(), self._P.copy())

    @property
    def _x(self) -> Array:
        return np.asarray(self._history.steps.x[self._history.newest[()]])

    @property
    def _P(self) -> Array:
        return np.asarray(self._history.steps.P[self._history.newest[()]])

    @property
    def t(self) -> float:
        """Time of the last readings, s."""
        return float(self._history.steps.end[self._history.newest[()]])

    @property
    def pose(self) -> Array:
        """(3,) x, y, theta in the map, m and rad; theta is not wrapped."""
        return self._x[:3].copy()

    @property
    def q(self) -> Array:
        """(n,) the same, and the joints as of the last `update`, m and rad."""
        q = self._joints.copy()
        q[:3] = self._x[:3]
        return q

    @property
    def covariance(self) -> Array:
        """(3, 3) of x, y, theta in the map's axes, m and rad."""
        turn = turned_axes(float(self._x[2]))
        return turn @ self._P[:3, :3] @ turn.T

    @property
    def state_covariance(self) -> Array:
        """(d, d) of the error: along and across the platform, m, of theta, rad, of the bias, rad/s, and of
        the scales, the turns' last."""
        return self._P.copy()

    @property
    def odom(self) -> Array:
        """(3,) the pose in odom, m and rad: the same motions, without jumps; fixes change but the bias and
        the scales of later motions."""
        return self._history.odom.copy()

    @property
    def map_to_odom(self) -> Array:
        """(3,) the pose of odom in the map, m and rad: what a fix makes jump."""
        (x, y, theta), (x_o, y_o, theta_o) = self._x[:3], self._history.odom
        turned = theta - theta_o
        c, s = math.cos(turned), math.sin(turned)
        return np.array([x - c * x_o + s * y_o, y - s * x_o - c * y_o, math.remainder(turned, 2.0 * math.pi)])

    @property
    def bias(self) -> float:
        """Of the gyro, rad/s."""
        return float(self._x[3])

    @property
    def scales(self) -> dict[str, float]:
        """By which each counter's turning is multiplied, beside its `slip`; 1 where they are no part of the
        state."""
        k = len(self.counters)
        scales = 1.0 + self._x[4 : 4 + k] if len(self._x) > 4 else np.ones(k)
        return dict(zip(self.counters, scales.tolist(), strict=True))

    @property
    def turn_scale(self) -> float:
        """By which turns are multiplied; 1 where it is no part of the state."""
        return 1.0 + float(self._x[-1]) if len(self._x) > 4 + len(self.counters) else 1.0

    @property
    def outliers(self) -> int:
        """How many of the last fixes, by their times, were outliers, one after another."""
        fixes, count = self._history.fixes, 0
        for place in fixes.order[: self._history.fixed[()]][::-1]:
            if fixes.outcome[place] == rings.USED:
                return count
            count += int(fixes.outcome[place] == rings.OUTLIER)
        return count + int(self._history.outliers[()])
