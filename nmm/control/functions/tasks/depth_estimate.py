"""Where a point is, from pictures of it: its depth, or how fast it moves."""

from __future__ import annotations

import math

import numpy as np

from nmm.base.arrays import Array

#: Of a depth that is guessed: its standard deviation over it.
UNSURE = 0.5
#: Of a picture's coordinates at least, normalised; and how fast a point may wander, m/√s.
ALMOST_SURE, WANDERS = 1e-4, 5e-4
#: The least depth that is believed over the first guess, and the least of its inverse.
LEAST = 0.02
#: A point's speed is at first as unsure as what its acceleration makes of it in so long, s.
UNKNOWN = 1.0


class DepthEstimate:
    """Where a point is in the world, from pictures of it: an extended Kalman filter whose state is what the
    first picture should have shown, x and y, and the inverse of the depth there.

    A picture from the same place says nothing of the depth: without a translation across the ray there is no
    observation, and the guess stays (J. Montiel, J. Civera, A. Davison, Unified inverse depth
    parametrization for monocular SLAM, RSS 2006).

    Parameters
    ----------
    depth : the first guess, m
    noise : standard deviation of x and y, normalised
    """

    def __init__(self, depth: float, noise: float) -> None:
        self._first, self._noise = depth, max(noise, ALMOST_SURE)
        self._R, self._c, self._t = np.eye(3), np.zeros(3), -math.inf
        self._state, self._spread = np.zeros(3), np.zeros((3, 3))

    def update(self, t: float, x: float, y: float, R: Array, c: Array) -> Array:
        """The point (3,) after a picture taken at t, s, from c, m, in axes R, at normalised x and y."""
        if not math.isfinite(self._t):
            self._R, self._c, self._state = R, c, np.array([x, y, 1.0 / self._first])
            self._spread = np.diag([self._noise**2, self._noise**2, (UNSURE / self._first) ** 2])
        else:
            away = WANDERS * self._state[2] * math.sqrt(max(t - self._t, 0.0))  # over the depth
            self._spread += np.diag([away, away, away * self._state[2]]) ** 2
            turned, moved = R.T @ self._R, R.T @ (self._c - c)
            P_q = np.column_stack([turned[:, 0], turned[:, 1], moved])  # P, times the inverse depth
            P = P_q @ self._state + turned[:, 2]
            if P[2] > 0.0:
                seen = P[:2] / P[2]
                H = (P_q[:2] - np.outer(seen, P_q[2])) / P[2]
                spread = H @ self._spread @ H.T + self._noise**2 * np.eye(2)
                gain = np.linalg.solve(spread, H @ self._spread).T
                self._state = self._state + gain @ (np.array([x, y]) - seen)
                self._state[2] = min(max(self._state[2], LEAST / self._first), 1.0 / (LEAST * self._first))
                reduction = np.eye(3) - gain @ H
                self._spread = reduction @ self._spread @ reduction.T + self._noise**2 * gain @ gain.T
        self._t = max(self._t, t)
        x0, y0, inverse = self._state
        return np.asarray(self._c + self._R @ np.array([x0, y0, 1.0]) / inverse)

    @property
    def depth(self) -> tuple[float, float]:
        """The depth in the first picture, and its standard deviation, m."""
        inverse = float(self._state[2])
        return 1.0 / inverse, math.sqrt(self._spread[2, 2]) / inverse**2


class MotionEstimate:
    """Where a point of known depth is in the world and how fast it moves, from pictures of it: a Kalman
    filter with white noise as acceleration (Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with
    applications to tracking and navigation, 2001, sec. 6.2.2).

    Parameters
    ----------
    acceleration : its standard deviation, m/s², from one picture to the next
    """

    def __init__(self, acceleration: float) -> None:
        self._acceleration, self._t = acceleration, -math.inf
        self._state = np.zeros((2, 3))  # p, v; the axes have one covariance
        self._spread = np.zeros((2, 2))

    def update(self, t: float, point: Array, noise: float) -> tuple[Array, Array]:
        """The point (3,), m, and its velocity (3,), m/s, after a picture at t, s, that shows it at `point`,
        m, with a standard deviation of `noise`, m. The first one says nothing of the velocity."""
        if not math.isfinite(self._t):
            self._state[0], self._t = point, t
            self._spread[:] = np.diag([noise**2, (self._acceleration * UNKNOWN) ** 2])
        elif (h := t - self._t) > 0.0:
            self._t = t
            F, w = np.array([[1.0, h], [0.0, 1.0]]), np.array([0.5 * h * h, h])
            spread = F @ self._spread @ F.T + self._acceleration**2 * np.outer(w, w)
            gain = spread[:, 0] / (spread[0, 0] + noise**2)
            state = F @ self._state
            self._state = state + np.outer(gain, point - state[0])
            self._spread = spread - np.outer(gain, spread[0])
        return self._state[0].copy(), self._state[1].copy()
