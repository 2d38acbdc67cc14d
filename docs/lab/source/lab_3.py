# %% [markdown]
# # Lab 3: an arm in space, and tasks beside the first
#
# 45 minutes. You write the Jacobian of an arm in space on a platform, the error of a pose, a target that depends on q (eq. 13), the
# extended Jacobian, two levels of priority, and the manipulability ellipsoid.
#
# Replace each `...` by your answer and run the cell below it. Run the cells in order: Shift + Enter.
# The folder `check` must lie beside this notebook: both are in `docs/lab` of the repository. Your functions get arrays and give
# arrays; the checks try them on robots and tasks that no file has.

# %%
import check
import matplotlib.pyplot as plt
import numpy as np
from numpy import cos, pi, sin

import nmm

np.set_printoptions(precision=3, suppress=True)
robot = nmm.mount(nmm.load("differential_base", platform="unicycle"), "small_arm")
print("coordinates q:", *robot.q_names)
print("inputs      u:", *robot.u_names)
robot

# %% [markdown]
# ## 1. What a joint does to the hand (4 min)
#
# A joint turns all that it carries about its axis: a unit vector a, through a point p. With a rate of 1 rad/s the hand, which is at r, has
# a linear and an angular velocity in world axes. Stack them, the linear one first. (`np.cross` is the vector product.)


# %%
def joint_column(axis, point, hand):
    """(6,) from a (3,), p (3,) and r (3,)"""
    # answer
    return np.concatenate([np.cross(axis, hand - point), axis])
    # end


# %%
check.joint_column(joint_column)

# %% [markdown]
# ## 2. The Jacobian of the pose (7 min)
#
# The platform has two inputs: v along its heading θ, and ω about the vertical axis through (x, y). Five joints follow. In space the
# pose has 6 rows: J is 6 x 7, and one input is left over.


# %%
def J(platform, joints, hand):
    """(6, 7) from platform (x, y, θ), joints [(a, p), ...] in order, and r (3,)"""
    x, y, theta = platform
    # answer
    drive = np.array([cos(theta), sin(theta), 0, 0, 0, 0])
    upright = np.array([0, 0, 1]), np.array([x, y, 0])
    turns = [joint_column(axis, point, hand) for axis, point in [upright, *joints]]
    return np.column_stack([drive, *turns])
    # end


# %%
check.spatial_jacobian(J)

# %% [markdown]
# The robot above has its joints where its file says. By differences of the hand's position, as in lab 1:


# %%
def placed(q):
    """Where the robot's joints and its hand are: [(a, p), ...], r (3,), R (3, 3)"""
    configuration = nmm.Configuration(robot, q)
    links = [configuration.placement(f"link{k}") for k in range(1, 6)]
    axes = [2, 1, 1, 1, 2]  # of each link's own x, y, z
    hand = configuration.placement("ee")
    joints = [(link.rotation[:, axis], link.translation) for link, axis in zip(links, axes)]
    return joints, hand.translation, hand.rotation


if check.ready("joint_column", "spatial_jacobian"):
    q = robot.q({"theta": 0.7, "q1": 0.4, "q2": 0.5, "q3": 0.9, "q4": -0.3})
    joints, hand, _ = placed(q)
    step = 1e-6
    moved = [(placed(q + step * c)[1] - placed(q - step * c)[1]) / (2 * step) for c in robot.S(q).T]
    matrix = J(q[:3], joints, hand)
    print("largest difference:", abs(np.array(moved).T - matrix[:3]).max())
    print("singular values:", np.linalg.svd(matrix, compute_uv=False))

# %% [markdown]
# ## 3. How far is one orientation from another? (6 min)
#
# Orientations cannot be subtracted. A turn by φ about the unit vector a takes one to the other, and the rotation vector φ a is the error.
# For the matrix R of that turn
#
#     trace R = 1 + 2 cos φ,    R − Rᵀ = 2 sin φ [a]×,    [a]× = ( 0  −a_z  a_y;  a_z  0  −a_x;  −a_y  a_x  0 )
#
# Take care of R = I. (An angle from its sine and cosine, `np.arctan2`, is exact for small ones, too.)


# %%
def rotation_vector(R):
    """(3,) φ a, with 0 ≤ φ < π"""
    # answer
    sine_axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine, cosine = np.linalg.norm(sine_axis), (np.trace(R) - 1) / 2
    return sine_axis * (np.arctan2(sine, cosine) / sine if sine > 0 else 1)
    # end


# %%
check.rotation_vector(rotation_vector)

# %% [markdown]
# The loop of the pose: e = (r_d − r, rotation vector of R_d Rᵀ), u = J⁺ K e. All six errors decay with K, though the platform cannot
# move sideways.

# %%
K, dt = 2.0, 0.01
if check.ready("joint_column", "spatial_jacobian", "rotation_vector"):
    q = robot.q({"q1": 0.3, "q2": 0.3, "q3": 1.2, "q4": 0.6})
    _, r_d, R_d = placed(
        robot.q({"x": 0.5, "y": 0.4, "theta": 0.6, "q1": -0.4, "q2": 0.7, "q3": 0.8, "q5": 0.5})
    )
    sizes = []
    for _ in range(300):
        joints, r, R = placed(q)
        e = np.concatenate([r_d - r, rotation_vector(R_d @ R.T)])
        sizes.append([np.linalg.norm(e[:3]), np.linalg.norm(e[3:])])
        q = q + dt * robot.S(q) @ np.linalg.pinv(J(q[:3], joints, r)) @ (K * e)
    sizes = np.array(sizes)
    for name, size in zip(("position", "orientation"), sizes.T):
        print(f"{name}: decays with {-np.polyfit(dt * np.arange(300), np.log(size), 1)[0]:.3f} 1/s")
    plt.semilogy(dt * np.arange(300), sizes, label=["‖r_d − r‖ [m]", "turn [rad]"])
    plt.xlabel("t [s]")
    plt.legend()
    plt.show()

# %% [markdown]
# The line falls a little faster than K: Euler's step multiplies the error by 1 − K dt, and not by e^(−K dt).
#
# ## 4. A target that depends on q: J̄ (7 min)
#
# Back to the planar robot of lab 1. Its second link has the heading δ = θ + q1 + q2, and is to point from the hand at a point T. The target,
#
#     g(q) = atan2(T_y − r_y, T_x − r_x),
#
# moves as the hand does. The error g − δ changes by −J̄ u, with J̄ = (∂f/∂q − ∂g/∂q) S, eq. (13); f is δ here. Write J̄ with the hand's J.


# %%
def J_bar(hand, J, T):
    """(4,) from r (2,), the hand's J (2, 4) and T (2,)"""
    # answer
    to_x, to_y = T - hand
    dg_dr = np.array([to_y, -to_x]) / (to_x**2 + to_y**2)
    return np.array([0, 1, 1, 1]) - dg_dr @ J
    # end


# %%
check.target_jacobian(J_bar)

# %% [markdown]
# ## 5. The extended Jacobian (7 min)
#
# Two inputs are left over by the hand's position. Give them a task of two rows of their own, J_y u = ẏ, and solve both together:
#
#     J_e u = (ṙ, ẏ),    J_e = (J; J_y)


# %%
def EJ(J, rate, J_y, rate_y):
    """(4,) u with J u = rate and J_y u = rate_y; J and J_y (2, 4)"""
    # answer
    return np.linalg.solve(np.vstack([J, J_y]), np.concatenate([rate, rate_y]))
    # end


# %%
check.extended_jacobian(EJ)

# %% [markdown]
# Two laps of the circle of eq. (16): the second link points at (6, 2), and q1 goes to 45°. Does the robot come back to its posture?


# %%
def planar(q):
    """The planar robot's hand (2,) and its J (2, 4)"""
    links = np.array([[cos(a), sin(a)] for a in np.cumsum(q[2:])]) * np.array([[0.3], [0.5], [0.3]])
    carried = np.cumsum(links[::-1], axis=0)[::-1]
    drive = np.array([cos(q[2]), sin(q[2])])
    turns = np.stack([-carried[:, 1], carried[:, 0]])
    return q[:2] + links.sum(axis=0), np.column_stack([drive, turns])


if check.ready("target_jacobian", "extended_jacobian"):
    q, T, dt = np.array([-1, -1, pi, 0, 0]), np.array([6, 2]), 0.01
    for k in range(5001):
        r, Jr = planar(q)
        angle, speed = 5 / 4 * pi + 0.08 * pi * k * dt, 0.24 * pi
        r_d = 2 + 3 * np.array([cos(angle), sin(angle)])
        if k % 2500 == 0:
            print(f"lap {k // 2500}: q = {q}, off by {np.linalg.norm(r_d - r):.1e} m")
        rate = speed * np.array([-sin(angle), cos(angle)]) + r_d - r
        off = np.arctan2(*(T - r)[::-1]) - q[2:].sum()
        pointing = (off + pi) % (2 * pi) - pi
        J_y = np.array([J_bar(r, Jr, T), [0, 0, 1, 0]])
        u = EJ(Jr, rate, J_y, np.array([2 * pointing, 2 * (pi / 4 - q[3])]))
        q = q + dt * np.array([u[0] * cos(q[2]), u[0] * sin(q[2]), *u[1:]])

# %% [markdown]
# Inputs: 4 rows for 4. Coordinates: 4 rows for 5. What has no row, and what brings it back all the same?
#
# ## 6. Where the extended Jacobian fails (4 min)
#
# J and J_y may have full rank and J_e may not: an *algorithmic* singularity. Let the second link keep its heading, and q1 its angle: the rows of
# J_y are (0, 1, 1, 1) and (0, 0, 1, 0). Give a configuration where J_e is singular, to 1e-6, and the hand's J is not. (Which inputs
# leave both rows of J_y at rest? d = 0.3, l1 = 0.5, l2 = 0.3.)

# %%
q_algorithmic = ...  # answer: q_algorithmic = [0, 0, 0, np.arccos(-0.3 / 0.5), 0.4]

# %%
check.algorithmic_singularity(q_algorithmic)

# %% [markdown]
# ## 7. Priorities (6 min)
#
# Two tasks may contradict each other. Then the first is to be done, and the second as well as the first allows, with N₁ = I − J₁⁺ J₁:
#
#     u = J₁⁺ r₁ + (J₂ N₁)⁺ (r₂ − J₂ J₁⁺ r₁)
#
# N₁ has not full rank, and rounding hides it: `np.linalg.pinv(A, 1e-9)` takes singular values below 10⁻⁹ of the largest for 0.


# %%
def prioritised(J_1, r_1, J_2, r_2):
    """(n,) u: J_1 u = r_1, and ‖J_2 u − r_2‖ as small as that allows"""
    # answer
    first = np.linalg.pinv(J_1) @ r_1
    N = np.eye(J_1.shape[1]) - np.linalg.pinv(J_1) @ J_1
    return first + np.linalg.pinv(J_2 @ N, 1e-9) @ (r_2 - J_2 @ first)
    # end


# %%
check.priorities(prioritised)

# %% [markdown]
# The hand in space is to rise by 0.1 m/s and to keep its orientation; the platform and all five joints are to stand still.

# %%
if check.ready("spatial_jacobian", "priorities"):
    q = robot.q({"q1": 0.3, "q2": 0.3, "q3": 1.2, "q4": 0.6})
    joints, hand, _ = placed(q)
    rows, rise = J(q[:3], joints, hand), np.array([0, 0, 0.1, 0, 0, 0])
    for name, u in (
        ("pose first", prioritised(rows, rise, np.eye(7), np.zeros(7))),
        ("position first, then orientation", prioritised(rows[:3], rise[:3], rows[3:], rise[3:])),
        ("standing first", prioritised(np.eye(7), np.zeros(7), rows, rise)),
    ):
        print(f"{name}: the hand has {rows @ u}, ‖u‖ = {np.linalg.norm(u):.3f}")

# %% [markdown]
# ## 8. The manipulability ellipsoid (6 min)
#
# Inputs with ‖u‖ = 1 move the hand within an ellipsoid, {J u}. Its semi-axes are vectors: σ_k along the left singular vectors of J.


# %%
def semi_axes(J):
    """(s, s): a column for each semi-axis, the longest first; J (s, n)"""
    # answer
    directions, lengths, _ = np.linalg.svd(J, full_matrices=False)
    return directions * lengths
    # end


# %%
check.ellipsoid(semi_axes)

# %% [markdown]
# How fast can the hand go along a direction (a unit vector), and not aside, with ‖u‖ = 1?


# %%
def speed(J, direction):
    """m/s, from J (s, n) of full rank and direction (s,)"""
    # answer
    return 1 / np.linalg.norm(np.linalg.pinv(J) @ direction)
    # end


# %%
check.speed_along(speed)

# %% [markdown]
# The planar arm alone, and with its platform. Straight, the arm alone has an ellipse without breadth.

# %%
if check.ready("ellipsoid", "speed_along"):
    figure, pictures = plt.subplots(1, 3, figsize=(11, 4), sharex=True, sharey=True)
    around = np.array([[cos(a), sin(a)] for a in np.linspace(0, 2 * pi, 100)]).T
    for q2, picture in zip((0, 0.8, 1.6), pictures):
        rows = planar(np.array([0, 0, 0, 0.5, q2]))[1]
        for label, part in (("arm alone", rows[:, 2:]), ("with the platform", rows)):
            picture.plot(*(semi_axes(part) @ around), label=label)
        picture.set(aspect="equal", title=f"q2 = {q2}: {speed(rows, np.array([0, 1])):.2f} m/s sideways")
        picture.set_xlabel("ẋ [m/s]")
    pictures[0].set_ylabel("ẏ [m/s]")
    pictures[2].legend()
    plt.show()

# %%
check.score()

# %% [markdown]
# If there is time: where is the arm alone singular, and how small does the smallest singular value of the whole robot become?
# `nmm map unicycle_2r --task position --over q1,q2` in a terminal draws both.
