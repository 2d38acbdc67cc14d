# %% [markdown]
# # Lab 1: the model and its redundancy
#
# 45 minutes. You write the equations of a mobile manipulator and of its redundancy in NumPy: De Luca, Oriolo, Giordano,
# *Kinematic Modeling and Redundancy Resolution for Nonholonomic Mobile Manipulators*, ICRA 2006. The numbers of equations
# are that paper's.
#
# Replace each `...` by your answer and run the cell below it. It says whether the answer is right, or what is wrong with it.
# Run the cells in order: Shift + Enter. The folder `check` must lie beside this notebook: both are in `docs/lab` of the
# repository.

# %%
import check
import matplotlib.pyplot as plt
import numpy as np
from numpy import cos, pi, sin

import nmm

np.set_printoptions(precision=3, suppress=True)
d, l1, l2 = 0.3, 0.5, 0.3  # m
robot = nmm.load("unicycle_2r")
print("coordinates q:", *robot.q_names)
print("inputs      u:", *robot.u_names)

# %% [markdown]
# The robot: a platform on two driven wheels, (x, y) the middle of its axle, θ its heading. The arm stands d ahead of the axle;
# q1 is the angle from the platform to the first link, q2 from the first link to the second. The inputs are v and ω of the
# platform, and the rates of q1 and q2. Move it:

# %%
robot

# %% [markdown]
# ## 1. What the wheels allow (5 min)
#
# The platform cannot move sideways. Its velocities are, eq. (2),
#
#     (ẋ, ẏ, θ̇) = G(q) (v, ω)


# %%
def G(q):
    """(3, 2)"""
    x, y, theta, q1, q2 = q
    # answer
    return np.array([[cos(theta), 0], [sin(theta), 0], [0, 1]])
    # end


# %%
check.platform(G)

# %% [markdown]
# The arm is free. Together, eqs. (2) and (3) are
#
#     q̇ = S(q) u,    u = (v, ω, q̇1, q̇2)


# %%
def S(q):
    """(5, 4)"""
    # answer
    matrix = np.zeros((5, 4))
    matrix[:3, :2] = G(q)
    matrix[3:, 2:] = np.eye(2)
    return matrix
    # end


# %%
check.all_coordinates(S)

# %% [markdown]
# ## 2. The hand (12 min)
#
# Where is it? Eq. (14), r = f(q):


# %%
def f(q):
    """(2,) x and y of the hand, m"""
    x, y, theta, q1, q2 = q
    # answer
    a, b, c = theta, theta + q1, theta + q1 + q2
    return np.array([x + d * cos(a) + l1 * cos(b) + l2 * cos(c), y + d * sin(a) + l1 * sin(b) + l2 * sin(c)])
    # end


# %%
check.hand(f)

# %% [markdown]
# How does it move? Eqs. (4) and (15):
#
#     ṙ = (∂f/∂q) S(q) u = J(q) u


# %%
def J(q):
    """(2, 4)"""
    x, y, theta, q1, q2 = q
    # answer
    a, b, c = theta, theta + q1, theta + q1 + q2
    df_dq = np.array(
        [
            [1, 0, -d * sin(a) - l1 * sin(b) - l2 * sin(c), -l1 * sin(b) - l2 * sin(c), -l2 * sin(c)],
            [0, 1, d * cos(a) + l1 * cos(b) + l2 * cos(c), l1 * cos(b) + l2 * cos(c), l2 * cos(c)],
        ]
    )
    return df_dq @ S(q)
    # end


# %%
check.jacobian(J)

# %% [markdown]
# Without `check` you would take differences: drive a little ahead and back along each input, and look where the hand goes. The two
# matrices agree to about ten digits.

# %%
if check.ready("all_coordinates", "hand", "jacobian"):
    q = np.array([0.4, -0.2, 0.9, 0.5, -1.1])
    step = 1e-6
    moved = [(f(q + step * column) - f(q - step * column)) / (2 * step) for column in S(q).T]
    print("by differences:", np.array(moved).T, "J(q):", J(q), sep="\n")
    print("largest difference:", abs(np.array(moved).T - J(q)).max())

# %% [markdown]
# ## 3. How much is left over? (4 min)
#
# The paper counts twice. *Static* redundancy: how many coordinates are left when the hand is at its place. *Kinematic* redundancy:
# how many inputs are left when the hand has its velocity. Count them for two tasks: the position of the hand (2 rows), and its
# position with the heading of the second link (3 rows).

# %%
redundancy = {
    "position": (..., ...),  # answer: "position": (3, 2),
    "position and heading": (..., ...),  # answer: "position and heading": (2, 1),
}  # (static, kinematic)

# %%
check.redundancy(redundancy)

# %% [markdown]
# ## 4. What the inputs feel of an objective (5 min)
#
# What is left over can serve an objective. The one of the paper's first case keeps the second link upright in the picture
# and the first joint at 45°:
#
#     H(q) = ½ (θ + q1 + q2 − π/2)² + ½ (q1 − π/4)²
#
# Resolvers need its gradient as the inputs see it: dH/dt = h · u.


# %%
def h(q):
    """(4,)"""
    x, y, theta, q1, q2 = q
    # answer
    sum_off, q1_off = theta + q1 + q2 - pi / 2, q1 - pi / 4
    return S(q).T @ np.array([0, 0, sum_off, sum_off + q1_off, sum_off])
    # end


# %%
check.gradient(h)

# %% [markdown]
# ## 5. The projected gradient (7 min)
#
# The least inputs that do the task, and the descent of H, projected so that the task does not feel it; eqs. (5) to (7):
#
#     u = J⁺ ṙ − α (I − J⁺ J) h
#
# Three lines. `np.linalg.pinv` is the pseudoinverse.


# %%
def PG(J, rate, h, alpha):
    """(4,) inputs u with J u = rate; J (2, 4), rate (2,), h (4,)"""
    # answer
    inverse = np.linalg.pinv(J)
    N = np.eye(J.shape[1]) - inverse @ J
    return inverse @ rate - alpha * N @ h
    # end


# %%
check.projected_gradient(PG)

# %% [markdown]
# ## 6. The reduced gradient (8 min)
#
# Two of the inputs, u_a, do the task. The other two, u_b, descend H, and what that makes u_a do counts, too. With J_a and J_b the columns of
# J of each, and h_a and h_b the entries of h, eqs. (9) and (10) are
#
#     u_b = −α (h_b − (J_a⁻¹ J_b)ᵀ h_a),    u_a = J_a⁻¹ (ṙ − J_b u_b)
#
# Five lines. `np.linalg.solve(A, B)` is A⁻¹ B, and `J[:, basic]` are columns of J.


# %%
def RG(J, rate, h, alpha, basic):
    """(4,) inputs u with J u = rate; basic: where u_a stands in u, as [0, 2] for (v, q1)"""
    free = [j for j in range(4) if j not in basic]
    u = np.zeros(4)
    # answer
    Ja, Jb = J[:, basic], J[:, free]
    u[free] = -alpha * (h[free] - np.linalg.solve(Ja, Jb).T @ h[basic])
    u[basic] = np.linalg.solve(Ja, rate - Jb @ u[free])
    return u
    # end


# %%
check.reduced_gradient(RG)

# %% [markdown]
# ## 7. When does J_a lose rank? (4 min)
#
# RG inverts a block of J. The robot may be far from any singularity and the block singular all the same. Look at the block of u_a = (v, q1):

# %%
if check.ready("jacobian"):
    q1 = np.linspace(-pi, pi, 200)
    for basic, name in (([0, 1], "v, omega"), ([0, 2], "v, q1")):
        plt.plot(q1, [np.linalg.det(J([0, 0, 0, angle, 0.5])[:, basic]) for angle in q1], label=f"({name})")
    plt.axhline(0, color="gray", linewidth=0.8)
    plt.xlabel("q1 [rad], q2 = 0.5")
    plt.ylabel("det J_a [m]")
    plt.legend()
    plt.show()

# %% [markdown]
# Give a configuration where the block of (v, q1) is singular, to 1e-6. (Multiply its determinant out first: most terms cancel.)

# %%
q_singular = ...  # answer: q_singular = [0, 0, 0, pi / 2, 0]

# %%
check.singular_block(q_singular)

# %% [markdown]
# The two determinants in the figure differ by d everywhere, so that they never vanish together: the paper's RG changes from one
# to the other in time. With the arm far enough from the axle there is nothing to change. Give such a d:

# %%
d_far = ...  # answer: d_far = 0.9  # above l1 + l2

# %%
check.far_from_the_axle(d_far)

# %%
check.score()

# %% [markdown]
# If there is time: which d makes the robot itself singular, and where? `nmm singularities unicycle_2r --task position --symbolic`
# in a terminal has all of it as formulas.
