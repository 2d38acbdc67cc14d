# %% [markdown]
# # Lab 2: closing the loop
#
# 40 minutes. You close the loop of the robot of lab 1, see how fast its error decays and what the redundancy costs, and at the end choose gains, objective and limits for a robot whose motors are small.
#
# Replace each `...` by your answer and run the cell below it. Run the cells in order: Shift + Enter.
# The folder `check` must lie beside this notebook: both are in `docs/lab` of the repository.

# %%
import check
import matplotlib.pyplot as plt
import numpy as np
from numpy import cos, pi, sin

import nmm

np.set_printoptions(precision=3, suppress=True)
robot = nmm.load("unicycle_2r")
objective = nmm.Quadratic(
    nmm.QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}, pi / 2), nmm.QuadraticTerm("q1", pi / 4)
)

# %% [markdown]
# What you wrote in lab 1, here by `nmm`:


# %%
def S(q):
    return robot.S(q)


def f(q):
    return nmm.Configuration(robot, q).placement("ee").translation[:2]


def J(q):
    return nmm.Configuration(robot, q).jacobian("ee")[:2] @ S(q)


def h(q):
    return S(q).T @ objective.gradient(nmm.Configuration(robot, q))


def PG(J, rate, h, alpha):
    return nmm.ProjectedGradient(alpha).resolve(nmm.Problem(J, rate, h)).u


# %% [markdown]
# ## 1. The rate that the task asks for (5 min)
#
# The hand is to follow a circle, eq. (16). The error is e = r_d − r. It decays as ė = −K e if the hand moves with
#
#     ṙ = ṙ_d + K e

# %%
K, alpha = 1.0, 10.0


def circle(t):
    """r_d (2,) m, and its velocity (2,) m/s"""
    angle, speed = 5 / 4 * pi + 0.08 * pi * t, 0.08 * pi
    r_d = np.array([2 + 3 * cos(angle), 2 + 3 * sin(angle)])
    return r_d, 3 * speed * np.array([-sin(angle), cos(angle)])


def rate(t, q):
    """(2,) m/s"""
    # answer
    r_d, r_d_dot = circle(t)
    return r_d_dot + K * (r_d - f(q))
    # end


# %%
check.task_rate(rate)

# %% [markdown]
# ## 2. The closed loop (4 min)
#
# The resolver turns that rate into inputs, the wheels and joints turn the inputs into motion: q̇ = S(q) u, with u = PG(J, rate, h, α).


# %%
def q_dot(t, q):
    """(5,) m/s, rad/s"""
    # answer
    return S(q) @ PG(J(q), rate(t, q), h(q), alpha)
    # end


# %%
check.closed_loop(q_dot)

# %% [markdown]
# ## 3. Integrating it (5 min)
#
# One step from t to t + dt, for any velocity(t, q). Euler's takes the velocity at the beginning. Write it; the classical Runge-Kutta
# step is given.


# %%
def euler_step(velocity, t, q, dt):
    """q at t + dt"""
    # answer
    return q + dt * velocity(t, q)
    # end


def rk4_step(velocity, t, q, dt):
    """q at t + dt, from four velocities"""
    k1 = velocity(t, q)
    k2 = velocity(t + dt / 2, q + dt / 2 * k1)
    k3 = velocity(t + dt / 2, q + dt / 2 * k2)
    k4 = velocity(t + dt, q + dt * k3)
    return q + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


# %%
check.euler(euler_step)

# %% [markdown]
# On the robot: halving dt halves Euler's error, and divides the other one's by 16. At 10 ms Euler's is the larger still, for the same
# number of velocities as Runge-Kutta's at 40 ms.

# %%
start = np.array([-1, -1, pi, 0, 0])


def integrate(step, duration, dt):
    """times (N,), coordinates (N, 5)"""
    t, q = np.arange(round(duration / dt) + 1) * dt, [start]
    for moment in t[:-1]:
        q.append(step(q_dot, moment, q[-1], dt))
    return t, np.array(q)


if check.ready("closed_loop", "euler"):
    exact = integrate(rk4_step, 1, 0.0025)[1][-1]
    for step in (euler_step, rk4_step):
        errors = [np.linalg.norm(integrate(step, 1, dt)[1][-1] - exact) for dt in (0.04, 0.02, 0.01)]
        print(f"{step.__name__:10}", "errors at dt = 40, 20, 10 ms:", *(f"{error:.1e}" for error in errors))

# %% [markdown]
# ## 4. How fast does the error decay? (5 min)
#
# ‖e(t)‖ = ‖e(0)‖ e^(−K t), if all is right. Find K from samples of ‖e‖. (`np.polyfit(t, y, 1)` fits a line and gives its slope first.)


# %%
def gain(t, error):
    """K, 1/s, from times (N,) and ‖e‖ (N,)"""
    # answer
    return -np.polyfit(t, np.log(error), 1)[0]
    # end


# %%
check.fitted_gain(gain)

# %%
if check.ready("closed_loop", "fitted_gain"):
    t, q = integrate(rk4_step, 8, 0.02)
    error = np.array([np.linalg.norm(circle(moment)[0] - f(at)) for moment, at in zip(t, q)])
    print(f"K = {gain(t, error):.4f} 1/s")
    figure, (path, decay) = plt.subplots(1, 2, figsize=(10, 4))
    path.plot(*np.array([circle(moment)[0] for moment in t]).T, "--", label="circle")
    path.plot(*np.array([f(at) for at in q]).T, label="hand")
    path.plot(q[:, 0], q[:, 1], label="platform")
    path.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    path.legend()
    decay.semilogy(t, error)
    decay.set(xlabel="t [s]", ylabel="‖e‖ [m]")
    plt.show()

# %% [markdown]
# ## 5. RG and PG: H, effort, peaks (6 min)
#
# The paper finds that RG holds H lower than PG at the same α. What does that cost? Two numbers for the inputs: their effort ∫‖u‖² dt,
# and the peak of each.


# %%
def effort(t, u):
    """∫‖u‖² dt, for times (N,), evenly spaced, and inputs (N, 4)"""
    # answer
    return np.trapezoid(np.sum(u**2, axis=1), t)
    # end


# %%
check.effort(effort)


# %%
def peaks(u):
    """(4,) the largest size of each input"""
    # answer
    return abs(u).max(axis=0)
    # end


# %%
check.peaks(peaks)

# %% [markdown]
# The paper's case 2: the end-effector on the circle, the second link pointing at (6, 2).

# %%
if check.ready("effort", "peaks"):
    case_2 = nmm.Scenario.load("unicycle_2r_pointing")
    for kind, step_size in (("rg", 10), ("pg", 10)):
        run = case_2.with_resolver(kind).with_settings({"resolver.alpha": step_size}).run()
        label = f"{kind}, α = {step_size}"
        print(
            f"{label}: effort {effort(run.t, run.u):.3f}, peaks of {', '.join(robot.u_names)}: {peaks(run.u)}"
        )
        plt.semilogy(run.t, np.maximum(run.objective, 1e-12), label=label)
    plt.xlim(0, 6)
    plt.xlabel("t [s]")
    plt.ylabel("H")
    plt.legend()
    plt.show()

# %% [markdown]
# At which α does PG spend as much effort as RG? Which of the two has the lower H then, which the lower peaks? Try in the cell above.
#
# ## 6. Limits (4 min)
#
# A motor does not give more than it can. `nmm` then gives the hand a share λ of the velocity that the task asks for, in the same direction:
# J u = λ ṙ. Find λ from u.


# %%
def share(J, u, rate):
    """λ, from J (2, 4), u (4,) and rate (2,)"""
    # answer
    return (J @ u) @ rate / (rate @ rate)
    # end


# %%
check.share_left(share)

# %%
if check.ready("share_left"):
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, 0.08 * pi, 5 / 4 * pi), gain=1)
    for largest in (4, 2, 1, 0.5):
        controller = nmm.Controller(
            *(robot, task, nmm.ProjectedGradient(alpha), objective),
            limits=nmm.Limits(velocity={"platform": largest, "arm": largest}),
        )
        step = controller.evaluate(0.0, start)
        print(
            f"inputs up to {largest}: λ = {share(step.J, step.u, step.rate):.3f} (nmm: {step.scale[0]:.3f})"
        )

# %% [markdown]
# ## 7. Design (8 min)
#
# This robot has small motors. Its hand begins beside a path that takes 20 s. Choose a gain, a resolver with its α, an objective and limits such that
#
# - from t = 5 s on the hand is at most 1 cm from where it should be;
# - |v| ≤ 0.8 m/s, and ω and the joints stay below 1.5 rad/s;
# - v changes by at most 1.5 m/s in a second, ω by 4 rad/s, each joint by 6 rad/s: a robot has a mass;
# - from t = 5 s on −2 ≤ q2 ≤ −0.8 rad: the elbow stays bent.
#
# What you may need: `nmm.ProjectedGradient(alpha=…)`, `nmm.ReducedGradient(alpha=…)`, `nmm.PreferredPosture({"q1": …})`,
# `nmm.Limits(velocity={"v": …, "omega": …, "arm": …}, acceleration={…})`, or `None` for no limits. Begin without limits, and look at
# what the check says.

# %%
design = {
    "gain": ...,  # answer: "gain": 2.0,
    "resolver": ...,  # answer: "resolver": nmm.ProjectedGradient(alpha=1.0),
    "objective": ...,  # answer: "objective": nmm.PreferredPosture({"q1": 0.6, "q2": -1.2}),
    "limits": ...,  # answer: "limits": nmm.Limits(velocity={"v": 0.8, "omega": 1.5, "arm": 1.5}, acceleration={"v": 1.5, "omega": 4, "arm": 6}),
}

# %%
check.design(design)

# %% [markdown]
# Its motion, right or not. Who passes with the smallest ∫‖u‖² dt?

# %%
check.drive(design)

# %%
check.score()
