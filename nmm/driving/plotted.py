"""What a page plots of a driven robot: channels, and their values in a look."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from nmm.driving.driven import Driven, Look
from nmm.playback.channels import Channel, still_channels


def channels(driven: Driven) -> tuple[Channel, ...]:
    """What is plotted: `values` in this order."""
    robot, rows = driven.robot, [row for target in driven.targets for row in target.rows]
    units = ", ".join(dict.fromkeys(unit for _, unit in rows))
    inputs, coordinates = (still_channels(robot)[part] for part in (slice(robot.n_u), slice(robot.n_u, None)))
    none = np.zeros(0)
    return (
        Channel("error_norm", "‖e‖", units, "error", none, log=True),
        *([Channel("objective", "H", "", "H", none)] if driven.has_objective else []),
        Channel("sigma_min", "σ_min", "", "sigma", none),
        Channel("scale_0", "λ", "", "scale", none),
        *inputs,
        *(Channel(f"error_{name}", f"e of {name}", unit, "components", none) for name, unit in rows),
        *coordinates,
    )


def values(driven: Driven, look: Look) -> list[float | None]:
    step = look.step
    found = [float(np.linalg.norm(step.error)), *([step.objective] if driven.has_objective else [])]
    found += [look.sigma_min, float(step.scale.min(initial=1.0)), *step.u, *step.error, *step.q]
    return numbers(found)


def numbers(values: Iterable[float]) -> list[float | None]:
    """JSON has no other numbers than finite ones."""
    return [float(value) if math.isfinite(value) else None for value in values]
