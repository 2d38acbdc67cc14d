"""A map: measures over a plane, with where they are singular."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from nmm.analysis.maps.measures import MEASURES, Evaluator, unit_of
from nmm.analysis.maps.singular_set import SingularSet
from nmm.analysis.singular.parts import WHOLE
from nmm.base.arrays import Array, Integers
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.base.lazy_call import lazy_call
from nmm.model.robots.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Smallest and largest that differ by less than this, of the largest in size, differ by rounding.
SAME = 1e-9
EVERYWHERE = "everywhere"


class Extreme(NamedTuple):
    """A value, where on the map it is, and on what: a singular set, in words, "everywhere" where the map has
    no other value, or "" for a cell's sample.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> result = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20)
    >>> smallest = result.extremes("sigma_min")["smallest"]
    >>> isinstance(smallest, nmm.analysis.Extreme), round(smallest.value, 4)
    (True, 0.2135)
    """

    value: float
    at: tuple[float, float]
    on: str = ""


@dataclass(frozen=True, eq=False)
class About:
    """What a map speaks of.

    Attributes
    ----------
    robot, task, part : the robot's name, the rows of its task, whose columns of J
    t, alpha, weights : s; the arm's share in "weighted"; W's diagonal by input, where it is not 1
    units, sizes : of each measure; in a sentence, what of different units counts as equal
    q_names, q_units : of the robot's coordinates

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> result = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20)
    >>> isinstance(result.about, nmm.analysis.About), result.about.robot, result.about.task
    (True, 'unicycle_2r', ('ee.x', 'ee.y'))
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
        robot, rows = evaluator.robot, evaluator.jacobians.rows
        units = {}
        for name, measure in evaluator.measures.items():
            part = measure.parts[-1] if measure.parts else evaluator.part
            own = [robot.u_units[j] for j in evaluator.columns[part]]
            # In sizes J is free of units.
            units[name] = "" if evaluator.scaled else unit_of(measure, [row.unit for row in rows], own)
        length = evaluator.length
        notes = [f"L = {length:g} m counts as 1 rad"] if length is not None else []
        notes += [f"size of {name} {value:g}" for name, value in evaluator.sizes.items()]
        if not notes and "mixed units" in units.values():
            notes = ["1 m counts as 1 rad"]
        weights = zip(robot.u_names, evaluator.weights, strict=True)
        return cls(
            robot=robot.name,
            task=evaluator.jacobians.row_names,
            part=evaluator.part,
            t=evaluator.t,
            alpha=evaluator.alpha,
            weights={name: float(weight) for name, weight in weights if weight != 1.0},
            units=units,
            sizes=", ".join(notes),
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
    robot : what is mapped
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

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> result = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20)
    >>> sorted(path.name for path in result.save("map").iterdir())
    ['map.json', 'map.npz', 'sigma_min.png']
    """

    kind: Literal["coordinates", "workspace"]
    robot: Robot
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
        """ "smallest" and "largest" value of a measure, with where; NaN in a map without any number.

        A grid misses the singular places between its nodes. There the value is known without a sample.

        Parameters
        ----------
        worst : of a workspace's worst postures; there the singular places count, among the best they do not,
            as the best posture is not the singular one
        """
        values = (self.worst if worst else self.values)[measure]
        extremes = {}
        for end, pick in (("smallest", np.nanargmin), ("largest", np.nanargmax)):
            if np.isnan(values).all():
                extremes[end] = Extreme(np.nan, (np.nan, np.nan))
                continue
            row, column = np.unravel_index(pick(values), values.shape)
            where = float(self.axes[0][column]), float(self.axes[1][row])
            extremes[end] = Extreme(float(values[row, column]), where)
        known = self._singular_sets(measure)
        between = known if self.kind == "coordinates" or worst else []
        value = MEASURES[measure].where_singular
        everywhere = any(singular.everywhere for singular, _ in known)
        seen = [extremes["smallest"].value, extremes["largest"].value, *([value] if between else [])]
        if everywhere or max(seen) - min(seen) <= SAME * max(map(abs, seen)):
            return {
                end: Extreme(value if everywhere else extreme.value, extreme.at, EVERYWHERE)
                for end, extreme in extremes.items()
            }
        for singular, whose in between[:1]:
            x, y = (singular.lines[0] if singular.lines else singular.points)[0]
            on = f"the {whose}singular {' and '.join(singular.kinds)}"
            extremes["largest" if value > 0.0 else "smallest"] = Extreme(value, (float(x), float(y)), on)
        return extremes

    def _singular_sets(self, measure: str) -> list[tuple[SingularSet, str]]:
        """The singular sets that give a measure its value `where_singular`, and whose: "" or "arm's "."""
        part, sets = self.about.part, []
        if measure == "arm_manipulability":
            sets.append((self.singular if part == "arm" else self.arm_singular, "arm's "))
        if part == WHOLE or not MEASURES[measure].parts:
            sets.append((self.singular, ""))
        return [(singular, whose) for singular, whose in sets if singular is not None and not singular.empty]

    @property
    def held(self) -> dict[str, float]:
        """Coordinates that are the same all over the map, by name; the platform's, in a workspace."""
        if self.kind == "coordinates":
            held = zip(self.about.q_names, self.q.tolist(), strict=True)
            return {name: value for name, value in held if name not in self.names}
        reached = np.isfinite(next(iter(self.values.values())))
        postures = next(iter(self.best_q.values()))[reached]
        same = np.all(postures == postures[:1], axis=0) if len(postures) else np.ones(len(self.q), dtype=bool)
        return {name: float(self.q[i]) for i, name in enumerate(self.about.q_names) if same[i]}

    def summary(self) -> dict[str, Any]:
        """What was computed, in plain data."""
        return lazy_call("nmm.views.folders.map:summary")(self)

    def plot(self, measure: str | None = None, path: str | Path | None = None) -> Figure:
        """The figure of a measure (the first one by default); written, too, where a path is given."""
        return lazy_call("nmm.views.figures.maps:map_figure")(self, measure, path)

    def save(self, folder: str | Path, *, figures: FigureOptions = PLAIN) -> Path:
        """Write map.npz, map.json and a figure a measure.

        Parameters
        ----------
        folder : a new folder, or one of a map, which is replaced
        figures : their formats and width

        Raises
        ------
        InputError : the folder exists and is not a map's, or cannot be written
        """
        return lazy_call("nmm.views.folders.map:save")(self, folder, figures=figures)
