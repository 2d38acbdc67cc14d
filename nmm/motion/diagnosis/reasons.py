"""Why a task error exceeds its expected decay: what a run shows there."""

from collections.abc import Iterator

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.control.directions import WORLD_PARTS, in_world_axes, lost_directions, weakest_direction
from nmm.control.functions.function import Row, row_scales
from nmm.control.resolvers.damped_least_squares import DampedLeastSquares
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.reach import Reach, joint_position, reach
from nmm.motion.diagnosis.error_bound import Departure, TaskSamples

#: Below this ratio of smallest to largest singular value of the scaled J a departure is put down to it.
SINGULAR = 0.02
#: Between two samples J counts as singular where its least singular value falls to this share of theirs.
DIP = 0.1
#: Points between two samples at which J is evaluated.
BETWEEN = 40
#: The error grows by less than this in one step, times 1 + its size (m, rad): feedback lets it fall.
JUMP = 0.01
#: An arm is stretched where its frame is this share of its reach from its first joint, and what it can hardly
#: do is a motion along that line (cosine).
STRETCHED, ALONG = 0.75, 0.9
#: A robot still moves whose inputs are this share of their largest over the last part of a run.
MOVES, LATE = 0.01, 0.1
#: Fewer switches of the partition are not reported.
SWITCHES = 3


def lost_words(controller: Controller, q: Array, J: Array) -> list[str]:
    """What nothing moves of the task at or near q (n,), from its matrix J (s, m)."""
    return lost_directions(*_in_world_axes(controller, q, J)) if np.all(np.isfinite(J)) else []


def weakest_words(controller: Controller, q: Array, J: Array) -> str:
    """What of the task the inputs move the least at q (n,), from its matrix J (s, m)."""
    return weakest_direction(*_in_world_axes(controller, q, J))


def _in_world_axes(controller: Controller, q: Array, J: Array) -> tuple[Array, tuple[Row, ...], Array]:
    """J in world axes, the task's rows, and their scales."""
    robot, rows = controller.robot, controller.rows
    return in_world_axes(J, controller.task, robot, q), rows, row_scales(rows, robot)


def out_of_reach(controller: Controller, q: Array, target: Array) -> Finding | None:
    """Whether the target (s,) is farther from an arm's first joint than the arm is long; of a platform that
    drives only by its height, which no platform changes."""
    robot = controller.robot
    for frame, places, arm, joint in _arms(controller, q):
        fixed = [axis for axis in places if axis == 2 or not robot.platform.n_p]
        away = float(np.linalg.norm([target[places[axis]] - joint[axis] for axis in fixed]))
        if fixed and away > arm.length:
            where = "above" if fixed == [2] and target[places[2]] > joint[2] else "from"
            values = {"frame": frame, "away": away, "side": where, "joint": arm.joint, "length": arm.length}
            return Finding("out_of_reach", values)
    return None


def stretched(controller: Controller, q: Array, J: Array) -> Finding | None:
    """Whether an arm is stretched along its weakest direction."""
    turned, _, scales = _in_world_axes(controller, q, J)
    y = np.linalg.svd(turned / scales[:, np.newaxis])[0][:, -1]
    for frame, places, arm, joint in _arms(controller, q):
        line = Configuration(controller.robot, q).placement(frame).translation - joint
        away = float(np.linalg.norm(line))
        along = sum(y[row] * line[axis] for axis, row in places.items())
        if away > STRETCHED * arm.length and abs(along) > ALONG * away * np.linalg.norm(y):
            values = {"frame": frame, "away": away, "length": arm.length, "joint": arm.joint}
            return Finding("stretched", values)
    return None


def singularity(
    controller: Controller, samples: TaskSamples, q: Array, departure: Departure
) -> Iterator[Finding | None]:
    """Whether J was singular between two samples, or nearly so, where the error exceeds its decay."""
    first, last = max(0, departure.first - 1), min(len(q) - 1, departure.worst + 1)
    norm = np.linalg.norm(samples.error, axis=1)
    grown = np.diff(norm[first : last + 1]) >= JUMP * (1.0 + norm[first:last])
    if grown.any():
        passed = _passed(controller, samples, q, first + int(np.argmax(grown)))
        if passed is not None:
            yield passed
            return
    ratios = _ratios(controller, samples.J[first : last + 1])
    least, k = float(ratios.min()), first + int(np.argmin(ratios))
    if least < SINGULAR:
        yield near_singularity("near_singularity", controller, samples.t[k], q[k], samples.J[k], least)
        yield stretched(controller, q[k], samples.J[k])


def near_singularity(
    code: str, controller: Controller, t: float, q: Array, J: Array, ratio: float, **more: float
) -> Finding:
    """J (s, m) at q (n,) with a ratio of singular values near 0."""
    values = {"condition": float(1.0 / max(ratio, 1e-300)), "lost": weakest_words(controller, q, J), **more}
    return Finding(code, values, {"t": float(t)})


def switching(samples: TaskSamples, departure: Departure) -> Finding | None:
    switches = np.any(np.diff(samples.partition, axis=0) != 0, axis=1)
    count = int(np.sum(switches[max(0, departure.first - 1) :]))
    return Finding("partition_switching", {"times": count}) if count >= SWITCHES else None


def inputs_fell_short(controller: Controller, samples: TaskSamples, departure: Departure) -> Finding | None:
    """With what damped them, where damped least squares did at the worst sample."""
    excess = float(np.linalg.norm(samples.error[departure.worst]) - departure.bound[departure.worst])
    if departure.unmet[departure.worst] < 0.5 * excess:
        return None
    resolver, J = controller.resolver, samples.J[departure.worst]
    values: dict[str, float] = {}
    if isinstance(resolver, DampedLeastSquares):
        root = resolver.setup(controller.solver.dimensions).numbers[DampedLeastSquares.root_at :]
        C = np.reshape(root, (-1, J.shape[1]))
        scaled = J / row_scales(controller.rows, controller.robot)[:, np.newaxis]
        sigma = np.linalg.svd(scaled @ C if C.size else scaled, compute_uv=False)[-1]
        if sigma < resolver.threshold:
            values = {"sigma": float(sigma), "threshold": resolver.threshold}
    return Finding("inputs_fell_short", values)


def still_moving(controller: Controller, samples: TaskSamples) -> Finding | None:
    """Whether the robot still moves at the end, unasked, though its target is at rest."""
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
        return None
    values = {
        "name": robot.u_names[j],
        "mean": float(mean[j]),
        "unit": robot.u_units[j],
        "duration": float(samples.t[-1] - samples.t[late][0]),
    }
    return Finding("still_moving", values)


def unresolved(samples: TaskSamples, departure: Departure) -> Finding | None:
    """The change of the inputs along the step on which the error exceeds its expected decay."""
    k = max(1, departure.first)
    before, after = samples.u[k - 1], samples.u[k]
    larger = max(float(np.linalg.norm(before)), float(np.linalg.norm(after)))
    change = float(np.linalg.norm(after - before))
    if larger == 0.0 or change < 0.5 * larger:
        return None
    return Finding("inputs_changed", {"percent": 100 * change / larger}, {"t": float(samples.t[k])})


def _passed(controller: Controller, samples: TaskSamples, q: Array, k: int) -> Finding | None:
    """Whether J is singular between sample k and the next one."""
    t = float(samples.t[k])
    ways = [(1 - share) * q[k] + share * q[k + 1] for share in np.linspace(0.0, 1.0, BETWEEN + 1)]
    try:
        matrices = np.array([controller.evaluate(t, way).J for way in ways])
    except Exception:  # a user's function may raise anything, where it was not made for
        return None
    if not np.all(np.isfinite(matrices)):
        return None
    ratios = _ratios(controller, matrices)
    least = int(np.argmin(ratios))
    if ratios[least] >= DIP * min(ratios[0], ratios[-1]) and ratios[least] >= SINGULAR:
        return None
    norm = np.linalg.norm(samples.error, axis=1)
    lost = weakest_words(controller, ways[least], matrices[least])
    values = {"before": float(norm[k]), "after": float(norm[k + 1]), "lost": lost}
    return Finding("singularity_passed", values, {"t": t})


def _ratios(controller: Controller, J: Array) -> Array:
    """Smallest over largest singular value of scaled matrices (K, s, m), (K,)."""
    scales = row_scales(controller.rows, controller.robot)
    values = np.linalg.svd(J / scales[:, np.newaxis], compute_uv=False)
    return np.asarray(values[:, -1] / np.maximum(values[:, 0], 1e-300))


def _arms(controller: Controller, q: Array) -> Iterator[tuple[str, dict[int, int], Reach, Array]]:
    """Frames positioned in the world by finite arms: rows of world axes, the arm, its origin (3,)."""
    robot, row = controller.robot, 0
    by_frame: dict[str, dict[int, int]] = {}
    for task in controller.task:
        function = task.function
        rows = function.rows(robot)
        if getattr(function, "relative_to", None) is None and hasattr(function, "frame"):
            for i, task_row in enumerate(rows):
                frame, _, part = task_row.name.rpartition(".")
                if frame == function.frame and WORLD_PARTS.get(part, 3) < 3:
                    by_frame.setdefault(frame, {})[WORLD_PARTS[part]] = row + i
        row += len(rows)
    for frame, places in by_frame.items():
        arm = reach(robot, frame)
        if arm is not None and np.isfinite(arm.length):
            yield frame, places, arm, joint_position(robot, q, arm.joint)
