"""The tractor with trailers: a unicycle that pulls N >= 1 of them, each hitched on an axle or off it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, scalar
from nmm.base.errors import expect, one_or_several
from nmm.base.kernels.compiled import PLATFORM, kernel, scratch
from nmm.base.text_format import apart
from nmm.model.platforms.base import Platform, coordinates_with, of_many
from nmm.model.platforms.steering import SteeredAxle, SteeringPivot
from nmm.model.platforms.unicycle import roll_ahead
from nmm.model.platforms.wheel_layout import (
    NEAR,
    Layout,
    Pivot,
    check_axle,
    misfit,
    rolls_forward,
    same,
    symmetric_limit,
    wheels_on,
)

#: Beyond its limit a hitch is folded by more than this, rad.
_SLACK = 1e-9


@kernel(PLATFORM)
def tractor(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """From body to body, with (v, ω) of the axle in front and its derivatives in b_1, b_2, ..., hitch angle
    b, hitch h and length l; parameters = [h_1, l_1, h_2, l_2, ...]:

    ω' = -(v sin b + h ω cos b) / l,  v' = v cos b - h ω sin b,  b_dot = ω' - ω."""
    trailers = parameters.shape[0] // 2
    roll_ahead(qp, G, G_q)
    G[2, 1] = 1.0
    v_b = scratch(trailers)
    w_b = scratch(trailers)
    for j in range(2):
        v = 1.0 - j
        w = 1.0 * j
        for i in range(trailers):
            h = parameters[2 * i]
            length = parameters[2 * i + 1]
            cosine = math.cos(qp[3 + i])
            sine = math.sin(qp[3 + i])
            v_next = v * cosine - h * w * sine
            w_next = -(v * sine + h * w * cosine) / length
            G[3 + i, j] = w_next - w
            for k in range(i):
                v_k = v_b[k] * cosine - h * w_b[k] * sine
                w_k = -(v_b[k] * sine + h * w_b[k] * cosine) / length
                G_q[3 + i, j, 3 + k] = w_k - w_b[k]
                v_b[k] = v_k
                w_b[k] = w_k
            v_b[i] = -v * sine - h * w * cosine
            w_b[i] = -v_next / length
            G_q[3 + i, j, 3 + i] = w_b[i]
            v = v_next
            w = w_next


@dataclass(frozen=True)
class Trailer:
    """One trailer. Its link's frame is at the hitch, x forward; its axle is at x = -length.

    Attributes
    ----------
    length : from the hitch to the trailer's axle, m
    hitch : of the hitch behind the axle of the body in front, m; 0 on the axle, negative ahead of it
    joint : name of the hitch's joint and coordinate: the trailer's angle from the body in front, rad
    max_angle : largest angle to either side, rad; None without

    Raises
    ------
    InputError : a length or max_angle that is not above zero

    Examples
    --------
    >>> trailer = nmm.Trailer(0.6, hitch=-0.2, max_angle=1.2)
    >>> nmm.Tractor([trailer]).coordinates
    ('x', 'y', 'theta', 'hitch1')
    """

    length: float
    hitch: float = 0.0
    joint: str = "hitch1"
    max_angle: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "length", positive(self.length, f"length of trailer {self.joint}"))
        object.__setattr__(self, "hitch", scalar(self.hitch, f"hitch of trailer {self.joint}"))
        if self.max_angle is not None:
            limit = positive(self.max_angle, f"max_angle of trailer {self.joint}")
            object.__setattr__(self, "max_angle", limit)


class Tractor(Platform):
    """qp = [x, y, theta, hitch1, ...] (m, m, rad, rad, ...), up = [v, omega] (m/s, rad/s) of the tractor.

    x, y is the midpoint of the tractor's axle, theta its heading from the world's x axis; each hitch's angle
    counts from the body in front, counter-clockwise.

    Parameters
    ----------
    trailers : from the tractor backwards
    limits : largest absolute value of each input by name, m/s and rad/s

    Raises
    ------
    InputError : no trailers, or things that are none; joints named twice or x, y or theta; a limit of an
        input that does not exist

    Examples
    --------
    >>> train = nmm.Tractor([nmm.Trailer(0.6), nmm.Trailer(0.6, hitch=-0.1, joint="hitch2")])
    >>> train.coordinates
    ('x', 'y', 'theta', 'hitch1', 'hitch2')
    >>> (train.G([0, 0, 0, 0.3, 0]) @ [1.0, 0.0]).round(3)
    array([ 1.   ,  0.   ,  0.   , -0.493,  0.41 ])
    """

    name = "tractor"
    inputs = ("v", "omega")
    input_units = ("m/s", "rad/s")
    velocity_map = tractor

    def __init__(self, trailers: Sequence[Trailer], *, limits: Mapping[str, float] | None = None) -> None:
        where, expected = f"{self.name}: trailers", "one Trailer or more, in a list"
        expect(isinstance(trailers, Iterable), where, expected, trailers)
        self.trailers = one_or_several(tuple(trailers), Trailer, where, expected)
        expect(self.trailers, where, expected, self.trailers)
        self.coordinates = coordinates_with(self.name, [trailer.joint for trailer in self.trailers])
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """The trailers of the file: the upright joints, one on another from the root's body on, whose names
        hold "hitch" or "trailer", each with wheels on one axle behind it; `InputError` where there is none,
        two are on one body, one is off the x axis, or a trailer lacks such wheels."""
        trailers: list[Trailer] = []
        carrier, axle = "theta", 0.0
        while named := [pivot for pivot in layout.pivots if pivot.carrier == carrier and pivot.hitches]:
            if len(named) > 1:
                expected = "at most one hitch on each body"
                raise misfit(layout, cls.name, expected, f"{carrier} carries several", named)
            (pivot,) = named
            if abs(pivot.y) > NEAR:
                expected = "hitches midway between the wheels of the body in front"
                raise misfit(layout, cls.name, expected, f"{pivot.joint} is off the x axis", named)
            length = _length(layout, cls.name, pivot)
            trailers.append(Trailer(length, axle - pivot.x, pivot.joint, symmetric_limit(pivot)))
            carrier, axle = pivot.joint, -length
        if not trailers:
            expected = 'an upright joint on the root\'s body with "hitch" or "trailer" in its name'
            raise misfit(layout, cls.name, expected, "there is none", layout.pivots)
        check_axle(layout, cls.name)
        return cls(trailers)

    @property
    def lengths(self) -> Mapping[str, float]:
        own = {f"length of trailer {trailer.joint}": trailer.length for trailer in self.trailers}
        return own | {f"hitch of trailer {trailer.joint}": trailer.hitch for trailer in self.trailers}

    @property
    def parameters(self) -> Array:
        return np.array([[trailer.hitch, trailer.length] for trailer in self.trailers]).ravel()

    @property
    def parameter_names(self) -> Mapping[str, str]:
        # H and L with the trailer's number; alone, the only one's.
        numbers = [str(i) for i in range(1, len(self.trailers) + 1)] if len(self.trailers) > 1 else [""]
        return {f"{letter}{number}": "" for number in numbers for letter in "HL"}

    @property
    def coordinate_limits(self) -> Array:
        """Those of each hitch are ±max_angle, if given."""
        limits = super().coordinate_limits
        for row, trailer in enumerate(self.trailers, 3):
            if trailer.max_angle is not None:
                limits[row] = [-trailer.max_angle, trailer.max_angle]
        return limits

    def described(self) -> dict[str, str]:
        return {
            f"trailer at {trailer.joint}": (
                f"hitch {trailer.hitch:g} m behind the axle ahead, length {trailer.length:g} m"
            )
            for trailer in self.trailers
        }

    def steered_axle(self, body: str) -> SteeredAxle | None:
        """A first trailer hitched on the tractor's axle is steered by the tractor; off it, it feels omega."""
        trailer = self.trailers[0]
        if body != trailer.joint or trailer.hitch != 0.0:
            return None
        pivot = SteeringPivot(trailer.joint, "omega", trailer.length, sign=-1.0)
        return SteeredAxle((pivot,), x=-trailer.length)

    @of_many
    def pfaffian(self, qp: Array) -> Array:
        """No axle slides along itself, the tractor's first.

        The axle of body i is at p_i = (x, y) - Σ_k a_k e_k, with e_k the direction of body k <= i and a_k the
        length along it between (x, y) and p_i: from its own hitch (for the tractor, its axle) to the next
        hitch, or to p_i. The row is n_i·p_i_dot = 0 with n_i across e_i.
        """
        # Directions as complex numbers: e_k = exp(j (θ + b_1 + ... + b_k)), without adding the angles.
        e = np.cumprod(np.exp(1j * qp[..., 2:]), axis=-1)
        axles = e.shape[-1]
        A = np.zeros((*qp.shape[:-1], axles, self.n_p))
        for i in range(axles):
            A[..., i, 0], A[..., i, 1] = -e[..., i].imag, e[..., i].real
            for k in range(i + 1):
                part = self.trailers[k - 1].length if k > 0 else 0.0
                part += self.trailers[k].hitch if k < i else 0.0
                # e_k_dot = n_k (θ_dot + b_1_dot + ... + b_k_dot)
                turned = part * (e[..., i] * e[..., k].conjugate()).real
                A[..., i, 2 : 3 + k] -= turned[..., np.newaxis]
        return A

    def problem(self, qp: ArrayLike) -> str | None:
        """The first hitch that is folded beyond its limit."""
        for trailer, angle in zip(self.trailers, np.asarray(qp)[3:], strict=True):
            if trailer.max_angle is not None and abs(angle) > trailer.max_angle + _SLACK:
                folded, limit = apart(math.degrees(abs(angle)), math.degrees(trailer.max_angle))
                return f"{trailer.joint} is folded to {folded} degrees, beyond its limit of {limit}"
        return None


def _length(layout: Layout, platform: str, pivot: Pivot) -> float:
    """From the hitch to the trailer's axle, m."""
    wheels = wheels_on(layout, pivot.joint)
    wrong = None
    if not wheels:
        wrong = f"the trailer on {pivot.joint} has none"
    elif not all(rolls_forward(wheel) for wheel in wheels):
        wrong = f"those on {pivot.joint} do not all roll forward"
    elif not same(wheel.x for wheel in wheels):
        wrong = f"those on {pivot.joint} are on several axles"
    elif wheels[0].x >= -NEAR:
        wrong = f"those on {pivot.joint} are not behind it"
    if wrong is not None:
        expected = "each trailer to have wheels on one axle behind its hitch"
        raise misfit(layout, platform, expected, wrong, wheels)
    return -wheels[0].x
