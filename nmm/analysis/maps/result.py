"""A map: measures over a plane, with where they are singular, and how it is written and drawn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nmm.analysis.maps.evaluation import Evaluator
from nmm.analysis.maps.extremes import EVERYWHERE, Extreme, extremes
from nmm.analysis.maps.measures import MEASURES, unit_of
from nmm.analysis.maps.singular_set import SingularSet
from nmm.arrays import Array, Integers
from nmm.runs.storage import has_format, replaced_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Marks a folder of a map.
FORMAT = "nmm map 1"


@dataclass(frozen=True, eq=False)
class About:
    """What a map speaks of.

    Attributes
    ----------
    robot, task, part : the robot's name, the rows of its task, whose columns of J
    t, alpha : s; the arm's share in "weighted"
    weights : W's diagonal by input, where it is not 1
    units : of each measure
    sizes : in a sentence, what of different units counts as equal
    q_names, q_units : of the robot's coordinates
    """

    robot: str
    task: tuple[str, ...]
    part: str
    t: float
    alpha: float
    weights: Mapping[str, float]
    units: Mapping[str, str]
    sizes: str
    q_names: tuple[str, ...]
    q_units: tuple[str, ...]

    @classmethod
    def of(cls, evaluator: Evaluator) -> About:
        """Of what an evaluator computes."""
        robot, rows = evaluator.robot, evaluator.jacobians.rows
        parts = {"arm_manipulability": "arm", "platform_manipulability": "platform", "weighted": "robot"}
        units = {}
        for name, measure in evaluator.measures.items():
            own = [robot.u_units[j] for j in evaluator.columns[parts.get(name, evaluator.part)]]
            # In sizes J is free of units.
            units[name] = "" if evaluator.scaled else unit_of(measure, [row.unit for row in rows], own)
        length = evaluator.length
        told = [f"L = {length:g} m counts as 1 rad"] if length is not None else []
        told += [f"size of {name} {value:g}" for name, value in evaluator.sizes.items()]
        if not told and "mixed units" in units.values():
            told = ["1 m counts as 1 rad"]
        weights = zip(robot.u_names, evaluator.weights, strict=True)
        return cls(
            robot=robot.name,
            task=evaluator.jacobians.row_names,
            part=evaluator.part,
            t=evaluator.t,
            alpha=evaluator.alpha,
            weights={name: float(weight) for name, weight in weights if weight != 1.0},
            units=units,
            sizes=", ".join(told),
            q_names=robot.q_names,
            q_units=robot.q_units,
        )


@dataclass(frozen=True, eq=False)
class Map:
    """Measures of J over two coordinates, or over a plane of the workspace.

    Cell [i, j] of every array is at (axes[0][j], axes[1][i]): the first axis runs along the columns.

    Attributes
    ----------
    kind : "coordinates" or "workspace"
    about : robot, task, weights, units
    names, units : of the axes: coordinates, or world axes of the frame
    axes : the columns' (columns,) and the rows' (rows,) coordinates, m or rad
    values : measures (rows, columns) by name, NaN where there is no J or nothing is reached; of a workspace
        the best over the arm's postures that put the frame in the cell's middle (on the rim, where that is
        out of reach, near it), as far as they were searched
    rank (rows, columns) : of the part's J; the largest found, in a workspace; -1 where nothing is reached
    singular : where the part's J loses rank; in a workspace, where the frame is in some such postures, as
        lines where these places lie on curves, else as points
    arm_singular : the same for the arm alone, where the platform has a part in the task; else None
    q (n,) : the coordinates that the axes do not change
    frame, height : of a workspace: the frame mapped, and the slab (m) that it was held to
    worst : of a workspace, as `values`, the worst over the postures
    best_q, worst_q : of a workspace, the postures (rows, columns, n) that have these values, by measure
    """

    kind: Literal["coordinates", "workspace"]
    about: About
    names: tuple[str, str]
    units: tuple[str, str]
    axes: tuple[Array, Array]
    values: Mapping[str, Array]
    rank: Integers
    singular: SingularSet
    arm_singular: SingularSet | None
    q: Array
    frame: str = ""
    height: tuple[float, float] | None = None
    worst: Mapping[str, Array] = field(default_factory=dict)
    best_q: Mapping[str, Array] = field(default_factory=dict)
    worst_q: Mapping[str, Array] = field(default_factory=dict)

    def q_at(self, row: int, column: int, measure: str | None = None) -> Array:
        """The configuration (n,) of a cell; in a workspace the one that has the measure's best value."""
        if self.kind == "workspace":
            return np.array(self.best_q[measure or next(iter(self.values))][row, column])
        q = self.q.copy()
        for axis, index in ((0, column), (1, row)):
            q[self.about.q_names.index(self.names[axis])] = self.axes[axis][index]
        return q

    def extremes(self, measure: str, *, worst: bool = False) -> dict[str, Extreme]:
        """ "smallest" and "largest" value of a measure, with where; see `nmm.analysis.maps.extremes`."""
        return extremes(self, measure, worst=worst)

    @property
    def held(self) -> dict[str, float]:
        """Coordinates that are the same all over the map, by name; the platform's, in a workspace."""
        if self.kind == "coordinates":
            return {
                name: float(value)
                for name, value in zip(self.about.q_names, self.q, strict=True)
                if name not in self.names
            }
        reached = np.isfinite(next(iter(self.values.values())))
        postures = next(iter(self.best_q.values()))[reached]
        same = np.all(postures == postures[:1], axis=0) if len(postures) else np.ones(len(self.q), dtype=bool)
        return {name: float(self.q[i]) for i, name in enumerate(self.about.q_names) if same[i]}

    def summary(self) -> dict[str, Any]:
        """What was computed, in plain data."""
        about = self.about
        return {
            "format": FORMAT,
            "kind": self.kind,
            "robot": about.robot,
            "task": list(about.task),
            "part": about.part,
            "t": about.t,
            "alpha": about.alpha,
            "weights": dict(about.weights),
            "sizes": about.sizes,
            "axes": [
                {
                    "name": name,
                    "unit": unit,
                    "from": float(axis[0]),
                    "to": float(axis[-1]),
                    "samples": len(axis),
                }
                for name, unit, axis in zip(self.names, self.units, self.axes, strict=True)
            ],
            "held": self.held,
            "frame": self.frame or None,
            "height": None if self.height is None else list(self.height),
            "measures": {
                name: {
                    "symbol": MEASURES[name].symbol,
                    "about": MEASURES[name].about,
                    "unit": about.units[name],
                    **_ends(self.extremes(name)),
                    **({"worst": _ends(self.extremes(name, worst=True))} if name in self.worst else {}),
                }
                for name in self.values
            },
            "singular": _found(self.singular),
            "arm_singular": None if self.arm_singular is None else _found(self.arm_singular),
        }

    def arrays(self) -> dict[str, Array | Integers]:
        """As map.npz holds them. Lines follow one another, a row of NaN between them."""
        found: dict[str, Any] = {
            "axis_0": self.axes[0],
            "axis_1": self.axes[1],
            "rank": self.rank,
            "q": self.q,
            "q_names": np.array(self.about.q_names),
        }
        found |= self.values
        for prefix, layer in (("worst", self.worst), ("best_q", self.best_q), ("worst_q", self.worst_q)):
            found |= {f"{prefix}_{name}": values for name, values in layer.items()}
        for prefix, those in (("singular", self.singular), ("arm_singular", self.arm_singular)):
            if those is not None:
                found[f"{prefix}_points"] = those.points
                found[f"{prefix}_lines"] = joined(those.lines)
        return found

    def plot(self, measure: str | None = None, path: str | Path | None = None) -> Figure:
        """The figure of a measure (the first one by default), written as PNG where a path is given."""
        from nmm.figures import style
        from nmm.figures.maps import map_figure

        made = map_figure(self, next(iter(self.values)) if measure is None else measure)
        if path is not None:
            style.save(made, path)
        return made

    def save(self, folder: str | Path) -> Path:
        """Write map.npz, map.json and a PNG a measure.

        Parameters
        ----------
        folder : a new folder, or one of a map, which is replaced

        Raises
        ------
        InputError : the folder exists and is not a map's, or cannot be written
        """
        with replaced_folder(folder, is_map) as temporary:
            np.savez_compressed(temporary / "map.npz", **self.arrays())  # type: ignore[arg-type]  # arrays by name
            text = json.dumps(self.summary(), indent=2, ensure_ascii=False)
            (temporary / "map.json").write_text(text + "\n", encoding="utf-8")
            for measure in self.values:
                self.plot(measure, temporary / f"{measure}.png")
        return Path(folder)


def is_map(folder: Path) -> bool:
    """Whether a folder holds a map that nmm wrote."""
    return has_format(folder / "map.json", FORMAT)


def joined(lines: tuple[Array, ...]) -> Array:
    """Curves (k, 2) as one, a row of NaN after each."""
    gap = np.full((1, 2), np.nan)
    return np.vstack([piece for line in lines for piece in (line, gap)]) if lines else np.zeros((0, 2))


def _found(those: SingularSet) -> dict[str, Any]:
    # Pieces of lines that cross, and both ends of a turn, make no count of lines.
    return {"lines": bool(those.lines), "points": len(those.points), "everywhere": those.everywhere}


def _ends(found: Mapping[str, Extreme]) -> dict[str, Any]:
    """Extremes in plain data; "on" says whether a cell has the value or a singular set between cells."""
    return {
        end: {
            "value": _plain(value),
            "at": None if on == EVERYWHERE else [_plain(x) for x in at],
            "on": on or "cell",
        }
        for end, (value, at, on) in found.items()
    }


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None
