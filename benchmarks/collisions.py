"""Time of a control step of TIAGo without distances and with them, in µs, all in one run:

    python benchmarks/collisions.py

TIAGo has 202 pairs of shapes, less those that always touch. `far` keeps all of them apart, and an obstacle
that is never near, with the pairs that are near anyhow; `near` adds obstacles about the hand until 20 pairs
are near. Asked for are at most 120 and 60 µs; interleaved, the best of each.
"""

from __future__ import annotations

import numpy as np
from step import microseconds

import nmm

HAND, NEAR = "arm_tool_link", 20
T, ROUNDS = 0.0, 5


def controllers() -> tuple[dict[str, nmm.Controller], np.ndarray]:
    """Without distances, with the pairs that are far, and with 20 that are near."""
    scenario = nmm.Scenario.load("tiago_pose")
    plain = scenario.controller()
    robot = plain.robot
    q = robot.q(scenario.parts.q0)

    def keeping(collisions: nmm.Collisions | None) -> nmm.Controller:
        given = (
            robot,
            plain.task,
            plain.resolver,
            plain.given.objective,
            None,
            plain.limits,
            scenario.parts.dt,
        )
        return nmm.Controller(*given, collisions=collisions)

    def active(controller: nmm.Controller) -> int:
        controller(T, q)
        assert controller.solver.scene is not None
        return int(controller.solver.scene.queries.scene.active.sum())

    far = [nmm.Obstacle(nmm.Sphere(0.1), [20.0, 0.0, 0.0], name="far")]
    found = {"none": keeping(None), "200 pairs": keeping(nmm.Collisions(0.02, obstacles=far))}
    # Only the obstacle's pairs, of which nearer ones come in as the band grows.
    hand = nmm.Configuration(robot, q).placement(HAND).translation
    ball = [nmm.Obstacle(nmm.Sphere(0.05), hand + np.array([0.15, 0.0, 0.0]), name="ball")]
    for band in np.arange(0.1, 3.0, 0.02):
        near = keeping(nmm.Collisions(0.02, obstacles=ball, self_collisions=False, band=float(band)))
        if active(near) >= NEAR:
            break
    found["20 near"] = near
    return found, q


def main() -> None:
    """Print the table."""
    found, q = controllers()
    times: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(ROUNDS):
        for name, controller in found.items():
            controller.reset()
            times[name].append(microseconds(lambda c=controller: c(T, q), 0.2))
    print(f"{'':12}{'pairs':>7}{'near':>6}{'rows':>6}{'looked':>8}{'µs':>8}{'ratio':>7}{'aim':>6}")
    for (name, controller), aim in zip(found.items(), (None, 120, 60), strict=True):
        counts = ""
        if controller.solver.scene is not None and controller.safety_filter is not None:
            scene = controller.solver.scene.queries.scene
            looked = "yes" if controller.safety_filter.held else "no"
            rows = int(controller.solver.step_memory.near.used)
            counts = f"{len(scene.pairs):7}{int(scene.active.sum()):6}{rows:6}{looked:>8}"
        best = min(times[name])
        print(f"{name:12}{counts:27}{best:8.1f}{best / min(times['none']):7.2f}{aim or '':>6}")


if __name__ == "__main__":
    main()
