"""A map's folder: its arrays, map.json and a figure for each measure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.analysis.maps.measures import MEASURES
from nmm.analysis.maps.result import EVERYWHERE, Extreme
from nmm.base.arrays import Array, Integers, finite
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.base.machine import made_with
from nmm.views.folders.whole import FolderKind, replaced_folder

if TYPE_CHECKING:
    from nmm.analysis.maps.result import Map
    from nmm.analysis.maps.singular_set import SingularSet

is_map = FolderKind("nmm map 1", "map.json")


def save(made: Map, folder: str | Path, *, figures: FigureOptions = PLAIN) -> Path:
    """Write map.npz, map.json and a figure for each measure, replacing a map's folder; InputError for one of
    anything else, or one that cannot be written."""
    with replaced_folder(folder, is_map) as temporary:
        np.savez_compressed(temporary / "map.npz", **_arrays(made))  # type: ignore[arg-type]  # arrays by name
        is_map.write(temporary, summary(made))
        from nmm.views.figures.maps import map_figure
        from nmm.views.figures.style import save_as

        for measure in made.values:
            save_as(map_figure(made, measure, **figures.across()), temporary, measure, figures)
    return Path(folder)


def summary(made: Map) -> dict[str, Any]:
    about = made.about
    return {
        "format": is_map.format,
        "made_with": made_with(),
        "kind": made.kind,
        "robot": about.robot,
        "task": list(about.task),
        "part": about.part,
        "t": about.t,
        "alpha": about.alpha,
        "weights": dict(about.weights),
        "sizes": about.sizes,
        "axes": [
            {"name": name, "unit": unit, "from": float(axis[0]), "to": float(axis[-1]), "samples": len(axis)}
            for name, unit, axis in zip(made.names, made.units, made.axes, strict=True)
        ],
        "held": made.held,
        "frame": made.frame or None,
        "height": None if made.height is None else list(made.height),
        "measures": {
            name: {
                "symbol": MEASURES[name].symbol,
                "about": MEASURES[name].about,
                "unit": about.units[name],
                **_ends(made.extremes(name)),
                **({"worst": _ends(made.extremes(name, worst=True))} if name in made.worst else {}),
            }
            for name in made.values
        },
        "singular": _found(made.singular),
        "arm_singular": None if made.arm_singular is None else _found(made.arm_singular),
    }


def _arrays(made: Map) -> dict[str, Array | Integers]:
    """The arrays of map.npz; a row of NaN is after each line."""
    gap = np.full((1, 2), np.nan)
    first: dict[str, Any] = {f"axis_{i}": axis for i, axis in enumerate(made.axes)}
    arrays = {**first, "rank": made.rank, "q": made.q, "q_names": np.array(made.about.q_names), **made.values}
    for prefix, layer in (("worst", made.worst), ("best_q", made.best_q), ("worst_q", made.worst_q)):
        arrays |= {f"{prefix}_{name}": values for name, values in layer.items()}
    for prefix, singular in (("singular", made.singular), ("arm_singular", made.arm_singular)):
        if singular is not None:
            arrays[f"{prefix}_points"] = singular.points
            arrays[f"{prefix}_lines"] = np.vstack(
                [piece for line in singular.lines for piece in (line, gap)] or [np.zeros((0, 2))]
            )
    return arrays


def _found(singular: SingularSet) -> dict[str, Any]:
    # Pieces of lines that cross, and both ends of a turn, make no count of lines.
    return {"lines": bool(singular.lines), "points": len(singular.points), "everywhere": singular.everywhere}


def _ends(extremes: Mapping[str, Extreme]) -> dict[str, Any]:
    """Extremes in plain data; "on" says whether a cell or a singular set between cells has the value."""
    return {
        end: {
            "value": finite(value),
            "at": None if on == EVERYWHERE else finite(at),
            "on": on or "cell",
        }
        for end, (value, at, on) in extremes.items()
    }
