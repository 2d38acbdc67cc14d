"""`python tests/helpers/faults.py [WORD …]`: whether the tests find faults that are put in on purpose.

Each fault is one line of nmm changed, in a copy of the package, and the test files that must fail with it. Words select
faults whose line of the list holds one. Kernels run as plain Python meanwhile, as each change would compile all anew;
that the compiled forms do the same is tested by itself (tests/control/test_compiled_forms.py). Prints a line each and a
count; exit status 1 where a fault was not found, or where the tests fail without any.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from places import ROOT

ALGEBRA = "base/test_linear_algebra.py"
ROTATIONS = "base/test_rotations.py"
KINEMATICS = "model/test_kinematics.py"
DERIVATIVES = "control/test_derivatives.py"
PLATFORMS = "model/test_platforms.py"
BOUNDS = "control/test_limits_sides.py::test_the_fastest_approach_brakes_exactly_at_its_limit control/test_limits_sides.py::test_beyond_its_limit_a_coordinate_returns_at_its_own_speed_and_no_farther"
LIMITS = "control/test_limits_kernel.py control/test_bounded_least_squares.py"
RESOLVERS = "control/test_resolvers.py"
DAMPING = "control/test_damping.py"
KERNELS = "nmm/base/kernels/"
PLATFORM_FILES = "nmm/model/platforms/"
LOADING = "nmm/model/robots/loading/"
TASKS = "nmm/control/functions/tasks/"
ROBOT = "nmm/plugins/robot/"
GYRO = "plugins/robot/test_pose_filter.py::test_a_gyro_is_what_joint_gaussians_make_of_it"
EXACT = "motion/test_localisation.py::test_without_noise_and_slip_the_run_is_that_of_odometry"
BELIEVED = "motion/test_localisation.py::test_what_is_believed_is_what_a_filter_says_of_the_same_sensors"


class Fault(NamedTuple):
    """file : of nmm; line : as it stands there once; instead : what takes its place; tests : files that find it"""

    file: str
    line: str
    instead: str
    tests: str


FAULTS = [
    # The velocity map and kinematics
    Fault(KERNELS + "velocity_map.py", "+= mimic_joints[i + 2] * rows[row, joint]", "+= rows[row, joint]", "model/test_mimic_joints.py::test_J_and_h_are_those_of_the_coordinates_through_S"),
    Fault(KERNELS + "velocity_map.py", "q_dot[joint] = mimic_joints[i + 2] * q_dot[leader]", "q_dot[joint] = q_dot[leader]", "model/test_mimic_joints.py::test_a_follower_of_the_platforms_own_joint_moves_with_it model/test_mimic_joints.py::test_J_and_h_are_those_of_the_coordinates_through_S"),
    Fault(KERNELS + "velocity_map.py", "who[i + 2] * q[int(who[i + 1])] + who[i + 3]", "who[i + 2] * q[int(who[i + 1])]", "model/test_mimic_joints.py::test_a_chain_of_followers model/test_mimic_joints.py::test_a_follower_of_the_platforms_own_joint_moves_with_it"),
    Fault(KERNELS + "kinematics.py", "c * first + s * second, c * second - s * first", "c * first - s * second, c * second + s * first", KINEMATICS),
    Fault(KERNELS + "kinematics.py", "out[1] = twists[i, 1] + c * x - a * z", "out[1] = twists[i, 1] + c * x + a * z", KINEMATICS),
    Fault(KERNELS + "kinematics.py", "near, far = (j, k) if d > c else (k, j)", "near, far = (j, k) if d < c else (k, j)", KINEMATICS),
    Fault(KERNELS + "kinematics.py", "= v[a] * m / total", "= v[a] * m", KINEMATICS),
    # Rotations
    Fault(KERNELS + "rotations.py", "sine = math.sin(angle) / angle if", "sine = math.sin(angle) if", ROTATIONS),
    Fault(KERNELS + "rotations.py", "w, y = R[0, 2] - R[2, 0], 1.0 + 2.0 * R[1, 1] - trace", "w, y = R[2, 0] - R[0, 2], 1.0 + 2.0 * R[1, 1] - trace", ROTATIONS),
    Fault(KERNELS + "rotations.py", "second = (angle - math.sin(angle)) / (angle * square)", "second = (angle - math.sin(angle)) / square", ROTATIONS),
    Fault(KERNELS + "rotations.py", "return c, 2.0 * slope", "return c, slope", ROTATIONS),
    Fault(KERNELS + "rotations.py", "A[i, j] = J[j, i]", "A[i, j] = J[i, j]", ROTATIONS),
    Fault(KERNELS + "rotations.py", "slope * along * wwp[i]", "along * wwp[i]", ROTATIONS),
    # Linear algebra
    Fault(KERNELS + "linear_algebra.py", "L[i, k] += overlap", "L[i, k] = overlap", ALGEBRA),
    Fault(KERNELS + "linear_algebra.py", "return last / max(1.0, first)", "return last", f"{ALGEBRA} {RESOLVERS}"),
    Fault(KERNELS + "linear_algebra.py", "determinant = -determinant", "determinant = 1.0 * determinant", ALGEBRA),
    Fault(KERNELS + "linear_algebra.py", "if size == 0.0:", "if size < 0.0:", ALGEBRA),
    Fault(KERNELS + "linear_algebra.py", "x -= L[k, i] * X[order[k], j]", "x -= L[i, k] * X[order[k], j]", ALGEBRA),
    Fault(KERNELS + "linear_algebra.py", "tangent = (1.0 if zeta >= 0.0 else -1.0) /", "tangent = 1.0 /", ALGEBRA),
    # The active set and limits
    Fault(KERNELS + "active_set.py", "return -rows.upper[member - 1 - c] - give, give", "return -rows.upper[member - 1 - c] + give, give", LIMITS),
    Fault(KERNELS + "active_set.py", "if basis.members[i] > 0 and multipliers[i] < least:", "if multipliers[i] < least:", LIMITS),
    Fault(KERNELS + "active_set.py", "until = max(multipliers[i], 0.0) / r[i]", "until = r[i]", LIMITS),
    Fault(KERNELS + "active_set.py", "scale = max(met, least)", "scale = least", LIMITS),
    Fault(KERNELS + "active_set.py", "b0 -= r[i] * own0", "b0 += r[i] * own0", LIMITS),
    Fault("nmm/control/limits/bounds.py", "return D / N + 0.5 * a * (N - 1.0)", "return D / N + a * (N - 1.0)", BOUNDS),
    Fault("nmm/control/limits/bounds.py", "return max(D, -recovery)", "return D", BOUNDS),
    Fault("nmm/control/limits/bounds.py", "least = problem.before[j] - limits.falling[j] * elapsed", "least = problem.before[j] - limits.rising[j] * elapsed", "control/test_limits_sides.py::test_inputs_fall_and_rise_by_no_more_than_each_side control/test_limits_sides.py::test_a_stop_brakes_as_hard_as_its_side_lets_it"),
    Fault("nmm/control/limits/bounds.py", "rate += steered * G[steer, j]", "rate += 0.0 * G[steer, j]", "control/test_limits_kinds.py::test_wheels_turn_as_fast_as_their_rows_say"),
    Fault("nmm/control/limits/bounds.py", "brakings(limits, i, problem.limit_rows[w + i])", "brakings(limits, i, problem.limit_rows[i])", "control/test_limits_kinds.py::test_functions_stay_between_their_limits control/test_limits_kinds.py::test_the_height_of_a_frame"),
    Fault("nmm/control/resolvers/saturation.py", "if problem.limit_levels[i] == 0:", "if problem.limit_levels[i] >= 0:", "control/test_limits_kernel.py::test_limits_that_contradict_give_way_by_what_those_that_are_always_kept_ask"),
    Fault("nmm/control/resolvers/saturation.py", "answer.nu[level] *= scale", "answer.nu[level] = 1.0", "control/test_limits_kept.py::test_each_resolver_finds_its_own_optimum control/test_limits_kept.py::test_the_recorded_scale_is_the_share_of_the_rate_also_where_rest_is_not_allowed"),
    # Resolvers
    Fault("nmm/control/resolvers/projected_gradient.py", "u0[j] = -alpha * problem.h[j]", "u0[j] = alpha * problem.h[j]", RESOLVERS),
    Fault("nmm/control/resolvers/reduced_gradient.py", "u[j] = -numbers[ALPHA] * reduced", "u[j] = -reduced", RESOLVERS),
    Fault("nmm/control/resolvers/reduced_gradient.py", "h[j] = numbers[C + j] * problem.h[j]", "h[j] = problem.h[j]", RESOLVERS),
    Fault("nmm/control/resolvers/extended_jacobian.py", "answer.status[()] = SINGULAR_JE if regular else SINGULAR_J", "answer.status[()] = SINGULAR_J", RESOLVERS),
    Fault(KERNELS + "damping.py", "return law.damping * law.damping * (1.0 - share * share)", "return law.damping * law.damping * (1.0 - share)", DAMPING),
    Fault(KERNELS + "damping.py", "weight * along)", "along)", DAMPING),
    Fault(KERNELS + "damping.py", "b[i] = less(b[i], A[i], done)", "b[i] = b[i]", f"{DAMPING} control/test_priorities.py"),
    # Platforms
    Fault(PLATFORM_FILES + "unicycle.py", "G_q[0, 0, 2] = -sine", "G_q[0, 0, 2] = sine", DERIVATIVES),
    Fault(PLATFORM_FILES + "unicycle.py", "G[2, 0] = -turn", "G[2, 0] = turn", PLATFORMS),
    Fault(PLATFORM_FILES + "car.py", "G[2, 0] = tangent / parameters[0]", "G[2, 0] = tangent", PLATFORMS),
    Fault(PLATFORM_FILES + "car.py", "G_q[2, 0, 3] = along / parameters[0]", "G_q[2, 0, 3] = across / parameters[0]", DERIVATIVES),
    Fault(PLATFORM_FILES + "tractor.py", "v_next = v * cosine - h * w * sine", "v_next = v * cosine + h * w * sine", PLATFORMS),
    Fault(PLATFORM_FILES + "tractor.py", "w_b[i] = -v_next / length", "w_b[i] = v_next / length", DERIVATIVES),
    Fault(PLATFORM_FILES + "omnidirectional.py", "G[2, 2] = radius / parameters[1]", "G[2, 2] = radius", PLATFORMS),
    Fault(PLATFORM_FILES + "skid_steer.py", "vy = -parameters[3] * rate", "vy = parameters[3] * rate", "model/test_skid_steer.py"),
    # Tasks, references, objectives
    Fault(TASKS + "position.py", "d[i] * (rows.value_q[i, k] - frames.jacobians", "d[i] * (rows.value_q[i, k] + frames.jacobians", DERIVATIVES),
    Fault(TASKS + "linear_coordinates.py", "rows.value_q[i, j] = numbers[i * n + j]", "rows.value_q[i, j] = 1.0", DERIVATIVES),
    Fault("nmm/control/functions/references/circle.py", "rate *= share * share * (3.0 - 2.0 * share)", "rate *= share", DERIVATIVES),
    Fault("nmm/control/functions/references/circle.py", "rows.value_t[first] = -radius * rate * math.sin(phase)", "rows.value_t[first] = radius * rate * math.sin(phase)", DERIVATIVES),
    Fault("nmm/control/functions/objectives/coordinates.py", "slope = 0.25 / (y * y) - 0.25 / (clamped * clamped)", "slope = 0.25 / (y * y)", DERIVATIVES),
    Fault("nmm/control/step/equations.py", "rate[i] = b.value_t[g] - b.value_t[f]", "rate[i] = b.value_t[g] + b.value_t[f]", "control/test_image_features.py::test_a_ball_that_moves_is_followed_with_its_motion_ahead"),
    Fault("nmm/control/step/equations.py", "error = math.pi - (math.pi - error) % (2.0 * math.pi)", "error = error % (2.0 * math.pi)", "control/test_full_turns.py::test_a_posture_is_reached_the_short_way_or_by_the_turns_that_count control/test_controller.py"),
    # Motion
    Fault("nmm/control/integrators.py", "[1 / 6, 1 / 3, 1 / 3, 1 / 6],", "[1 / 4, 1 / 4, 1 / 4, 1 / 4],", "motion/test_simulation.py::test_the_stability_limit_is_the_textbooks motion/test_judging.py::test_the_error_of_a_step_is_its_formula"),
    Fault("nmm/model/robots/zero_order_hold.py", "ahead[inputs.moved[j]] += dt * u[p + j]", "ahead[inputs.moved[j]] += dt * u[j]", "control/test_stepping.py model/test_separation.py motion/test_sampled.py"),
    Fault("nmm/control/goal.py", "return metres <= self.m and radians <= self.rad", "return metres <= self.m or radians <= self.rad", "control/test_reaching.py::test_a_run_ends_where_its_goal_is_reached control/test_reaching.py::test_a_goal_out_of_reach_is_missed_with_what_is_left"),
    # Files
    Fault(LOADING + "mjcf_numbers.py", "made = made @ step if letter.islower() else step @ made", "made = made @ step", "model/test_mjcf_mujoco.py"),
    Fault(LOADING + "mjcf_numbers.py", 'else math.pi / 180.0', 'else 1.0', "model/test_mjcf_mujoco.py model/test_mjcf.py"),
    Fault(LOADING + "mjcf_numbers.py", "y = unit(y - (x @ y) * x)", "y = unit(y)", "model/test_mjcf_mujoco.py"),
    Fault(LOADING + "joint_kinds.py", "for end in (-upper, -lower)", "for end in (lower, upper)", "model/test_axes_down.py"),
    Fault(LOADING + "extents.py", ".max(axis=0).min()", ".max(axis=0).max()", "model/test_mesh_wheels.py model/test_wheels.py"),
    Fault(LOADING + "packages.py", "file = self._of_mujoco(name) or self._nearby", "file = self._nearby", "model/test_file_elements.py::test_meshes_are_where_mujoco_looks_for_them"),
    Fault("nmm/plugins/robot/counted_motion.py", "* spread[c] * abs(by[c]) * noise[j, c]", "* spread[c] * noise[j, c]", "model/test_odometry.py"),
    Fault("nmm/plugins/robot/counted_motion.py", "rows[0, j] = P[0, j] - (ahead[1]", "rows[0, j] = P[0, j] + (ahead[1]", "model/test_odometry.py"),
    # A pose filter
    Fault(ROBOT + "filter_step.py", "way = abs(twist[2]) if i == 2", "way = 1.0 if i == 2", GYRO),
    Fault(ROBOT + "filter_step.py", "A[i, 4 + c] += G[i, m] * slopes[m, c]", "A[i, 4 + c] -= G[i, m] * slopes[m, c]", GYRO),
    Fault(ROBOT + "filter_fix.py", "z[m] - place[m] + D[m, 0] * eps[0]", "z[m] - place[m] - D[m, 0] * eps[0]", "plugins/robot/test_pose_filter.py::test_a_fix_is_what_a_search_for_the_likeliest_pose_finds"),
    Fault(ROBOT + "filter_history.py", "until = (fixes.t[fix] - start) / lasts", "until = 1.0", "plugins/robot/test_pose_filter_fixes.py::test_a_fix_within_a_step_is_taken_at_its_time"),
    Fault(ROBOT + "measured_state.py", "frame[0] + c * x - s * y", "frame[0] + c * x + s * y", "plugins/robot/test_pose_filter_loop.py::test_a_fix_moves_where_it_is_believed_to_be_without_new_readings"),
    Fault(ROBOT + "simulated_filter.py", "/ dt + sensors.bias + noise", "/ dt + noise", BELIEVED),
    Fault("nmm/control/plant.py", "by = dt * u + 0.5 * dt * dt * u_dot", "by = dt * u", EXACT),
]  # fmt: skip


def tests_fail(package: Path, files: str, seconds: float | None) -> bool:
    """Whether tests fail with a package in the place of the checkout's; `TimeoutExpired` after so many seconds."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(package)}
    options = [
        "-q",
        "-x",
        "-p",
        "no:cacheprovider",
        "--no-header",
        "-m",
        "not browser and not thorough",
        "-W",
        "ignore::RuntimeWarning",  # of NumPy's numbers where compiled ones overflow in silence
        "-n",
        "0",
    ]
    python = [sys.executable, "-P"]  # -P: not the checkout's nmm
    command = [*python, "-m", "pytest", *options, *(f"tests/{file}" for file in files.split())]
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=seconds
    )
    if done.returncode not in (0, 1):
        sys.exit(done.stdout[-1500:] + done.stderr[-2000:])
    return done.returncode == 1


def main(words: list[str]) -> int:
    picked = [fault for fault in FAULTS if not words or any(word in " ".join(fault) for word in words)]
    missed, sound = [], dict[str, tuple[bool, float]]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(ROOT / "nmm", folder / "nmm", ignore=shutil.ignore_patterns("__pycache__"))
        for beside in ("robots", "scenarios", "pyproject.toml"):
            (folder / beside).symlink_to(ROOT / beside)
        for fault in picked:
            start, path = time.monotonic(), folder / fault.file
            text = path.read_text("utf-8")
            if text.count(fault.line) != 1:
                sys.exit(f"{fault.file}: {text.count(fault.line)} times {fault.line!r}, expected 1")
            if fault.tests not in sound:
                sound[fault.tests] = not tests_fail(folder, fault.tests, None), time.monotonic() - start
            passes, usual = sound[fault.tests]
            path.write_text(text.replace(fault.line, fault.instead), "utf-8")
            try:
                hit = passes and tests_fail(folder, fault.tests, 60.0 + 5.0 * usual)
                said = "found" if hit else "NOT FOUND" if passes else "THE TESTS FAIL WITHOUT IT"
            except subprocess.TimeoutExpired:  # found where they never end, and not where the machine is busy
                hit, said = False, "THE TESTS DID NOT END"
            path.write_text(text, "utf-8")
            print(f"{said:10} {time.monotonic() - start:5.0f} s  {fault.file}: {fault.instead}", flush=True)
            missed += [] if hit else [fault]
    print(f"{len(picked) - len(missed)} of {len(picked)} found")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
