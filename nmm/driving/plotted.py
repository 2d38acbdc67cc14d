"""What a page plots of a driven robot: channels, and their values in a look."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from nmm.driving.driven import Driven, Look
from nmm.looks import pretty, rate
from nmm.playback.channels import Channel


def channels(driven: Driven) -> tuple[Channel, ...]:
    """What is plotted: `values` in this order."""
    robot, rows = driven.robot, [row for target in driven.targets for row in target.rows]
    units = ", ".join(dict.fromkeys(unit for _, unit in rows))
    ends = np.where(robot.limited, robot.q_limits, [-np.inf, np.inf])
    none = np.zeros(0)
    return (
        Channel("error_norm", "‖e‖", units, "error", none, log=True),
        *([Channel("objective", "H", "", "H", none)] if driven.has_objective else []),
        Channel("sigma_min", "σ_min", "", "sigma", none),
        Channel("scale_0", "λ", "", "scale", none),
        *(
            Channel(f"u_{name}", _input(driven, i), unit, "inputs", none, (-float(most), float(most)))
            for i, (name, unit, most) in enumerate(
                zip(robot.u_names, robot.u_units, robot.u_limits, strict=True)
            )
        ),
        *(Channel(f"error_{name}", f"e of {name}", unit, "components", none) for name, unit in rows),
        *(
            Channel(name, pretty(name), unit, "coordinates", none, (float(lower), float(upper)))
            for name, unit, (lower, upper) in zip(robot.q_names, robot.q_units, ends, strict=True)
        ),
    )


def _input(driven: Driven, column: int) -> str:
    name = driven.robot.u_names[column]
    return pretty(name) if column < driven.robot.platform.p else rate(name)


def values(driven: Driven, look: Look) -> list[float | None]:
    step = look.step
    found = [float(np.linalg.norm(step.error)), *([step.objective] if driven.has_objective else [])]
    found += [look.sigma_min, float(step.scale.min(initial=1.0)), *step.u, *step.error, *step.q]
    return numbers(found)


def numbers(values: Iterable[float]) -> list[float | None]:
    """JSON has no other numbers than finite ones."""
    return [float(value) if math.isfinite(value) else None for value in values]
