"""Rotations by their rotation vectors: exponential, logarithm and their derivatives, as plain loops.

A rotation vector φ (rad) is a unit axis times an angle; R = exp(φ^), φ^ the cross product with φ as a matrix.
The left Jacobian J(φ) gives the angular velocity ω = J(φ) φ_dot in the axes to which R maps; in the body's
own axes ω = J(φ)ᵀ φ_dot, with J(φ)ᵀ = J(-φ) the right Jacobian. (J. Solà, J. Deray, D. Atchuthan, A micro Lie
theory for state estimation in robotics, 2018, eqs. 131 to 146.) R is the first three columns of an array, so
a placement [R | p] serves, too.
"""

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, scratch

#: 1/3!, -1/5!, 1/7!, ...: (θ - sin θ)/θ³ in powers of θ².
_SINE = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800, 1 / 1307674368000)
#: |B_2k|/(2k)!, k = 1, 2, ... (Bernoulli's numbers): (1 - θ/2 cot θ/2)/θ² in powers of θ².
_COTANGENT = (
    1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000, 1 / 74724249600,
    3617 / 10670622842880000, 43867 / 5109094217170944000, 174611 / 802857662698291200000,
)  # fmt: skip


@compiled
def cross3(a: Array, b: Array, out: Array) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def times3(A: Array, x: Array, out: Array) -> None:
    for i in range(3):
        out[i] = A[i, 0] * x[0] + A[i, 1] * x[1] + A[i, 2] * x[2]


@compiled
def transposed_times3(A: Array, x: Array, out: Array) -> None:
    for i in range(3):
        out[i] = A[0, i] * x[0] + A[1, i] * x[1] + A[2, i] * x[2]


@compiled
def compose3(A: Array, B: Array, out: Array) -> None:
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@compiled
def between3(A: Array, B: Array, out: Array) -> None:
    """out = Aᵀ B: the rotation B as A's frame sees it."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]


@compiled
def polynomial_in_cross(phi: Array, first: float, second: float, out: Array) -> None:
    """out = I + first φ^ + second (φ^)²; the form of the exponential and of its Jacobians."""
    x, y, z = phi[0], phi[1], phi[2]
    out[0, 0] = 1.0 - second * (y * y + z * z)
    out[1, 1] = 1.0 - second * (z * z + x * x)
    out[2, 2] = 1.0 - second * (x * x + y * y)
    out[0, 1] = second * x * y - first * z
    out[1, 0] = second * x * y + first * z
    out[0, 2] = second * x * z + first * y
    out[2, 0] = second * x * z - first * y
    out[1, 2] = second * y * z - first * x
    out[2, 1] = second * y * z + first * x


@compiled
def half_square(angle: float) -> float:
    """(1 - cos θ)/θ², without cancellation."""
    half = 0.5 * angle
    ratio = math.sin(half) / half if half != 0.0 else 1.0
    return 0.5 * ratio * ratio


@compiled
def exp3(phi: Array, R: Array) -> None:
    """R = exp(φ^) (Rodrigues)."""
    angle = math.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    sine = math.sin(angle) / angle if angle != 0.0 else 1.0
    polynomial_in_cross(phi, sine, half_square(angle), R)


@compiled
def log3(R: Array, phi: Array) -> None:
    """The φ with R = exp(φ^) and |φ| <= π; at exactly π it is either of φ and -φ.

    By the unit quaternion, largest component first (S. W. Shepperd, 1978): equally accurate everywhere.
    """
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace >= max(R[0, 0], R[1, 1], R[2, 2]):
        w, x, y, z = 1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    elif R[0, 0] >= max(R[1, 1], R[2, 2]):
        w, x = R[2, 1] - R[1, 2], 1.0 + 2.0 * R[0, 0] - trace
        y, z = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]
    elif R[1, 1] >= R[2, 2]:
        w, y = R[0, 2] - R[2, 0], 1.0 + 2.0 * R[1, 1] - trace
        x, z = R[0, 1] + R[1, 0], R[1, 2] + R[2, 1]
    else:
        w, z = R[1, 0] - R[0, 1], 1.0 + 2.0 * R[2, 2] - trace
        x, y = R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine != 0.0 else 0.0
    phi[0], phi[1], phi[2] = factor * x, factor * y, factor * z


@compiled
def left_jacobian3(phi: Array, J: Array) -> None:
    """J(φ) = I + (1 - cos θ)/θ² φ^ + (θ - sin θ)/θ³ (φ^)², θ = |φ|."""
    square = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    angle = math.sqrt(square)
    if square < 0.25:
        second = 0.0
        for k in range(len(_SINE) - 1, -1, -1):
            second = second * square + _SINE[k]
    else:
        second = (angle - math.sin(angle)) / (angle * square)
    polynomial_in_cross(phi, half_square(angle), second, J)


@compiled
def inverse_factor(square: float) -> tuple[float, float]:
    """c = (1 - θ/2 cot θ/2)/θ² and c'(θ)/θ, from θ²; θ below 2π."""
    if square < 1.0:
        c, slope = 0.0, 0.0
        for k in range(len(_COTANGENT) - 1, -1, -1):
            slope = slope * square + c
            c = c * square + _COTANGENT[k]
        return c, 2.0 * slope
    half = 0.5 * math.sqrt(square)
    sine = math.sin(half)
    cotangent = math.cos(half) / sine
    c = (1.0 - half * cotangent) / square
    # c θ² = 1 - h cot h with h = θ/2, differentiated
    return c, (0.5 * (half / (sine * sine) - cotangent) / math.sqrt(square) - 2.0 * c) / square


@compiled
def left_jacobian_inverse3(phi: Array, J: Array) -> None:
    """J(φ)⁻¹ = I - φ^/2 + c (φ^)², c = (1 - θ/2 cot θ/2)/θ², θ = |φ| below 2π."""
    c, _ = inverse_factor(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    polynomial_in_cross(phi, -0.5, c, J)


@compiled
def log6(R: Array, p: Array, e: Array) -> None:
    """e = [v, w] (m, rad) with exp6(e) = (R, p), the body velocity that leads there in 1 s: p = J(w) v."""
    J = scratch((3, 3))
    log3(R, e[3:])
    left_jacobian_inverse3(e[3:], J)
    times3(J, p, e[:3])


@compiled
def log6_jacobian(e: Array, p: Array, A: Array, B: Array) -> None:
    """The derivative of log6 by the moving body's velocity [ν, ω], in its own axes: [[A, B], [0, A]].

    e = [v, w] = log6(R, p): v_dot = A ν + B ω, w_dot = A ω, when R_dot = R ω^, p_dot = R ν. A is the inverse
    right Jacobian of w; B = D A with D = ∂(J(w)⁻¹ p)/∂w at constant p. This is the inverse of the right
    Jacobian of SE(3) (T. D. Barfoot, State estimation for robotics, section 7.1.5, has D in another form).
    """
    w = e[3:]
    J = scratch((3, 3))
    left_jacobian_inverse3(w, J)
    for i in range(3):
        for j in range(3):
            A[i, j] = J[j, i]
    c, slope = inverse_factor(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    wp, wwp, u, up, wup, uwp = scratch(3), scratch(3), scratch(3), scratch(3), scratch(3), scratch(3)
    cross3(w, p, wp)
    cross3(w, wp, wwp)
    for k in range(3):
        for i in range(3):
            u[i] = A[i, k]
        along = w[0] * u[0] + w[1] * u[1] + w[2] * u[2]
        cross3(u, p, up)
        cross3(w, up, wup)
        cross3(u, wp, uwp)
        for i in range(3):  # of p - w × p / 2 + c w × (w × p)
            B[i, k] = -0.5 * up[i] + c * (uwp[i] + wup[i]) + slope * along * wwp[i]
