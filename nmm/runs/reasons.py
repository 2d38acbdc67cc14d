"""Why a task error went elsewhere than promised: what a run shows there, in sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.lost_directions import PARTS, in_world_axes, lost_directions, weakest_direction
from nmm.functions.function import row_scales
from nmm.robots.configuration import Configuration
from nmm.robots.reach import Reach, joint_position, reach
from nmm.runs.promise import Departure, Samples

#: Below this ratio of smallest to largest singular value of the scaled J a departure is put down to it.
SINGULAR = 0.02
#: Between two samples J counts as singular where its least singular value falls to this share of theirs.
DIP = 0.1
#: At how many points between two samples J is looked at.
BETWEEN = 40
#: The error grows by less than this in one step, times 1 + its size (m, rad): feedback lets it fall.
JUMP = 0.01
#: An arm is stretched where its frame is this share of its reach from its first joint, and what it can hardly
#: do is a motion along that line (cosine).
STRETCHED, ALONG = 0.75, 0.9
#: A robot still moves whose inputs are this share of their largest over the last part of a run.
MOVES, LATE = 0.01, 0.1
#: So many switches of the partition are told.
SWITCHES = 3


def lost_words(controller: Controller, q: Array, J: Array) -> list[str]:
    """What nothing moves of the task at or near q (n,), where its matrix is J (s, m)."""
    if not np.all(np.isfinite(J)):
        return []
    return lost_directions(_in_world_axes(controller, q, J), controller.rows, _scales(controller))


def weakest_words(controller: Controller, q: Array, J: Array) -> str:
    """What of the task the inputs move the least at q (n,), where its matrix is J (s, m)."""
    return weakest_direction(_in_world_axes(controller, q, J), controller.rows, _scales(controller))


def out_of_reach(controller: Controller, q: Array, target: Array) -> str:
    """A sentence where the target (s,) lies farther from an arm's first joint than the arm is long; else "".

    A platform that drives brings the joint along; only the height above the ground then counts, which no
    platform changes.
    """
    robot = controller.robot
    for frame, places, arm, joint in _arms(controller, q):
        fixed = [axis for axis in places if axis == 2 or not robot.platform.n_p]
        away = float(np.linalg.norm([target[places[axis]] - joint[axis] for axis in fixed]))
        if fixed and away > arm.length:
            where = "above" if fixed == [2] and target[places[2]] > joint[2] else "from"
            return (
                f"the target of {frame} is out of reach: it is {away:.3g} m {where} {arm.joint}, its "
                f"links add up to {arm.length:.3g} m"
            )
    return ""


def stretched(controller: Controller, q: Array, J: Array) -> str:
    """A sentence where an arm is stretched and its direction is the one that moves the least; else ""."""
    robot = controller.robot
    turned = _in_world_axes(controller, q, J)
    y = np.linalg.svd(turned / _scales(controller)[:, np.newaxis])[0][:, -1]
    for frame, places, arm, joint in _arms(controller, q):
        line = Configuration(robot, q).placement(frame).translation - joint
        away = float(np.linalg.norm(line))
        along = sum(y[row] * line[axis] for axis, row in places.items())
        if away > STRETCHED * arm.length and abs(along) > ALONG * away * np.linalg.norm(y):
            return f"the arm is stretched: {frame} is {away:.3g} m of {arm.length:.3g} m from {arm.joint}"
    return ""


def singularity(controller: Controller, samples: Samples, q: Array, found: Departure) -> str:
    """Whether J was singular between two samples, or nearly singular, where the error left its promise."""
    first, last = max(0, found.first - 1), min(len(q) - 1, found.worst + 1)
    norm = np.linalg.norm(samples.error, axis=1)
    grown = np.diff(norm[first : last + 1]) >= JUMP * (1.0 + norm[first:last])
    if grown.any():
        passed = _passed(controller, samples, q, first + int(np.argmax(grown)))
        if passed:
            return passed
    ratios = _ratios(controller, samples.J[first : last + 1])
    k = first + int(np.argmin(ratios))
    if ratios[k - first] >= SINGULAR:
        return ""
    words = [
        f"J is nearly singular at t = {samples.t[k]:.4g} s (condition number "
        f"{1 / max(ratios[k - first], 1e-300):.2g}), nearly lost: "
        f"{weakest_words(controller, q[k], samples.J[k])}",
        stretched(controller, q[k], samples.J[k]),
    ]
    return "; ".join(word for word in words if word)


def switching(samples: Samples, found: Departure) -> str:
    """Whether the partition kept switching there."""
    switches = np.any(np.diff(samples.partition, axis=0) != 0, axis=1)
    count = int(np.sum(switches[max(0, found.first - 1) :]))
    return f"from there on the partition switched {count} times" if count >= SWITCHES else ""


def inputs_unmet(samples: Samples, found: Departure) -> str:
    """Whether the error is that of inputs that did not do what the task asked."""
    excess = float(np.linalg.norm(samples.error[found.worst]) - found.bound[found.worst])
    if found.unmet[found.worst] < 0.5 * excess:
        return ""
    return "the inputs did not do all that the task asked (clipped, scaled or damped)"


def still_moving(controller: Controller, samples: Samples) -> str:
    """A sentence where the robot still moves at the end before a target that stands, and not as that asks."""
    asked, feedback = samples.rate, samples.feedback.rates(samples.error)
    late = samples.t >= samples.t[-1] - LATE * (samples.t[-1] - samples.t[0])
    lacks = samples.residual[late] > 0.5 * np.linalg.norm(asked[late], axis=1)
    stands = np.linalg.norm((asked - feedback)[late], axis=1) < MOVES * np.linalg.norm(feedback[late], axis=1)
    mean, largest = np.abs(samples.u[late]).mean(axis=0), np.abs(samples.u).max(axis=0)
    robot = controller.robot
    alike = np.equal.outer(robot.u_units, robot.u_units)
    share = mean / np.maximum(np.where(alike, largest, 0.0).max(axis=1), 1e-300)
    j = int(np.argmax(share))
    if not (lacks.all() and stands.all() and share[j] > MOVES):
        return ""
    return (
        f"the robot has not come to rest: |{robot.u_names[j]}| is {mean[j]:.3g} {robot.u_units[j]} on "
        f"average over the last {samples.t[-1] - samples.t[late][0]:.3g} s"
    )


def unresolved(samples: Samples, found: Departure) -> str:
    """How much the inputs changed along the step on which the error left its promise."""
    k = max(1, found.first)
    before, after = samples.u[k - 1], samples.u[k]
    larger = max(float(np.linalg.norm(before)), float(np.linalg.norm(after)))
    change = float(np.linalg.norm(after - before))
    if larger == 0.0 or change < 0.5 * larger:
        return ""
    return f"along that step the inputs changed by {100 * change / larger:.0f} % of their size"


def _scales(controller: Controller) -> Array:
    return row_scales(controller.rows, controller.robot)


def _in_world_axes(controller: Controller, q: Array, J: Array) -> Array:
    return in_world_axes(J, controller.task, controller.robot, q)


def _passed(controller: Controller, samples: Samples, q: Array, k: int) -> str:
    """Whether J is singular somewhere on the way from sample k to the next one."""
    shares = np.linspace(0.0, 1.0, BETWEEN + 1)
    t = samples.t
    ways = [(1 - share) * q[k] + share * q[k + 1] for share in shares]
    try:
        matrices = np.array([controller.evaluate(float(t[k]), way).J for way in ways])
    except Exception:  # a user's function may raise anything, where it was not made for
        return ""
    if not np.all(np.isfinite(matrices)):
        return ""
    ratios = _ratios(controller, matrices)
    least = int(np.argmin(ratios))
    if ratios[least] >= DIP * min(ratios[0], ratios[-1]) and ratios[least] >= SINGULAR:
        return ""
    norm = np.linalg.norm(samples.error, axis=1)
    words = weakest_words(controller, ways[least], matrices[least])
    return (
        f"at t = {t[k]:.4g} s the task error jumped from {norm[k]:.3g} to {norm[k + 1]:.3g} in one step: a "
        f"singular configuration was passed between two samples, lost there: {words}"
    )


def _ratios(controller: Controller, J: Array) -> Array:
    """Smallest over largest singular value of scaled matrices (K, s, m), (K,)."""
    values = np.linalg.svd(J / _scales(controller)[:, np.newaxis], compute_uv=False)
    return np.asarray(values[:, -1] / np.maximum(values[:, 0], 1e-300))


def _arms(controller: Controller, q: Array) -> Iterator[tuple[str, dict[int, int], Reach, Array]]:
    """Frames that tasks position, on arms of finite reach: see `_positioned`; where the arm begins (3,)."""
    for frame, places in _positioned(controller).items():
        arm = reach(controller.robot, frame)
        if arm is not None and np.isfinite(arm.length):
            yield frame, places, arm, joint_position(controller.robot, q, arm.joint)


def _positioned(controller: Controller) -> dict[str, dict[int, int]]:
    """For each frame that tasks position in the world: world axis -> the task's row."""
    found: dict[str, dict[int, int]] = {}
    row = 0
    for task in controller.task:
        function = task.function
        rows = function.rows(controller.robot)
        if getattr(function, "relative_to", None) is None and hasattr(function, "frame"):
            for i, one in enumerate(rows):
                frame, _, part = one.name.rpartition(".")
                if frame == function.frame and PARTS.get(part, 3) < 3:
                    found.setdefault(frame, {})[PARTS[part]] = row + i
        row += len(rows)
    return found
