"""The table of what a run records: each quantity is declared here, once.

All that handles quantities loops over `QUANTITIES`. A new quantity is an entry here and the code that
computes it: a function of what was recorded (`RecordedQuantity.of`), or, for what only a step knows, a line
in `nmm.control.step.recorded.note_sample`. An attribute of `Trajectory` or `Step` gives it a type; without
one it is `trajectory[name]`, `step[name]`. Its `since` is one more than the largest here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import expect_known
from nmm.base.kernels.spectra import spectra
from nmm.model.robots.robot import Robot


@dataclass(frozen=True)
class Record:
    """What a function of a quantity reads: `record[name]` of N samples, and whose they are.

    While a run is recorded, and of a `Step`, all that is `noted` is known; later what is `saved`, so that a
    quantity which is not saved itself is computed from that. A `Step` is a record of one sample.

    robot : that moved
    arrays : t (N,) and the quantities (N, ...) by name
    """

    robot: Robot
    arrays: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        """`InputError` for a quantity that is not known here."""
        expect_known("quantity", name, self.arrays)
        return self.arrays[name]


@dataclass(frozen=True)
class Number:
    """A number in a run's summary. What the samples of one quantity determine stands with that quantity; what
    several quantities, names or events determine together, in `nmm.motion.diagnosis.summary.RUN_NUMBERS`.

    key : in summary.json
    of : computes it from the times (N,) and the values (N, ...), or from the run; None for no number
    name, latex : in tables of runs, "" for none there; latex "" for the name
    about : in sweeps, "" for no column
    unit : "" for the quantity's
    after : of a whole run's number: the quantity after whose numbers it stands
    """

    key: str
    of: Callable[..., Any]
    name: str = ""
    latex: str = ""
    about: str = ""
    unit: str = ""
    after: str = ""


@dataclass(frozen=True)
class Curve:
    """How pages draw a quantity over time.

    Attributes
    ----------
    panel, title : the panel's name in the page's address, and its heading
    place : the panels' order
    text : the curve's name; "" for the quantity's symbol
    log : whether the scale is logarithmic: "never", "always", or "positive" for where no value is below 0
    if_true : the run's attribute that says whether it is drawn; "" for where it is not `fill` throughout
    lower : the lower limit that is drawn: a number, or the run's attribute that holds it
    exact : values nearer to 0 than this are rounding
    opens_below : the panel is initially open where a value is below this
    """

    panel: str
    title: str
    place: int
    text: str = ""
    log: str = "never"
    if_true: str = ""
    lower: float | str = -np.inf
    exact: float = 0.0
    opens_below: float = -np.inf


@dataclass(frozen=True)
class RecordedQuantity:
    """A quantity of each sample of a run.

    Attributes
    ----------
    name : in `Step`, the record, `Trajectory` and trajectory.npz, where it is present
    symbol, meaning : for people
    shape : a letter for each extent: N samples, n coordinates, m inputs, s rows of the task, l levels of
        priority, w values with limits, L limits with names, K samples or 0 where no distances are kept, P
        points that cameras see; a digit stands for itself
    unit : "" for none; "rows", "inputs" or "coordinates" for theirs
    whole : whether it holds integers
    fill : its value where it was not recorded, and while its task is not active
    since : the first version of the files that has it; in older files it is `fill` throughout
    noted : whether only a step knows it (`nmm.control.step.recorded.note_sample`)
    saved : whether the trajectory and its file hold it
    optional : whether a run may have none of it, None
    finite, bounded : whether a file with an infinite or impossibly large value of it is damaged
    counts : what integers index, -1 for none: "m" inputs, "p" pairs of shapes; and their name
    of : computes it from a record of N samples, (N, ...); None for what steps know or the run's end computes
    column : of trajectory.csv, {} for the component's name; "" for none
    place : the order of columns and numbers
    curve : how pages draw it; None where they do not, or do in their own way
    numbers : the summary's numbers of it
    line : what is printed of it unless it is `fill` throughout: a label, a format of the summary's numbers
    """

    name: str
    symbol: str
    meaning: str
    shape: str = "N"
    unit: str = ""
    whole: bool = False
    fill: float = np.nan
    since: int = 1
    noted: bool = False
    saved: bool = True
    optional: bool = False
    finite: bool = False
    bounded: bool = True
    counts: tuple[str, str] | None = None
    of: Callable[[Record], Any] | None = None
    column: str = ""
    place: int = 0
    curve: Curve | None = None
    numbers: tuple[Number, ...] = ()
    line: tuple[str, str] | None = None

    def absent(self, **sizes: int) -> Any:
        """Its value where it was not recorded; extents that are not given are 0."""
        return self.room(dict.fromkeys("NnmsLKP", 0) | {"l": 1} | sizes)

    def room(self, sizes: dict[str, int]) -> Any:
        """An array with these extents, `fill` everywhere."""
        shape = tuple(int(letter) if letter.isdigit() else sizes[letter] for letter in self.shape)
        return np.full(shape, self.fill, dtype=np.int64 if self.whole else np.float64)


def error_norm(record: Record) -> Array:
    """‖e‖ (N,) of the tasks active at each sample, in the mixed units of the rows; NaN without a task."""
    if not record["error"].shape[1]:
        return np.full(len(record["error"]), np.nan)
    return np.asarray(np.linalg.norm(np.where(np.isnan(record["error"]), 0.0, record["error"]), axis=1))


def lateral_slip(record: Record) -> Array:
    """The largest |A(qp) qp_dot| at each sample (N,), m/s."""
    platform = record.robot.platform
    slip = platform.sideways(record["q"][:, : platform.n_p], record["q_dot"][:, : platform.n_p])
    return np.asarray(np.abs(slip).max(axis=1, initial=0.0))


def drift(record: Record) -> Array:
    """How far the platform is from where it is believed to be at each sample (N,), m; (0,) where it is seen
    as it is."""
    believed = record.arrays.get("believed")
    if believed is None:
        return np.zeros(0)
    return np.asarray(np.hypot(*(believed - record["q"])[:, :2].T))


def partition_changes(record: Record) -> Integers:
    """1 at the samples from which RG has another partition, else 0 (N,)."""
    changes = np.zeros(len(record["partition"]), dtype=np.int64)
    changes[1:] = np.any(np.diff(record["partition"], axis=0) != 0, axis=1)
    return changes


def _late(t: Array, x: Array) -> Array:
    return np.asarray(x[t >= 0.5 * (t[0] + t[-1])])


def rms(x: Array) -> float:
    """The root of the mean square."""
    return float(np.sqrt(np.mean(x**2)))


_TABLE = (
    RecordedQuantity(
        "t", "t", "time", "N", "s", finite=True, column="t",
        numbers=(Number("t_end", lambda t, x: x[-1], "duration", about="its last instant"),),
    ),
    RecordedQuantity(
        "q", "q", "coordinates", "Nn", "coordinates", noted=True, finite=True, column="{}",
        curve=Curve("coordinates", "Coordinates", 9),
    ),
    RecordedQuantity(
        "u", "u", "inputs", "Nm", "inputs", noted=True, finite=True, column="u_{}",
        curve=Curve("inputs", "Inputs", 7, opens_below=np.inf),
    ),
    RecordedQuantity(
        "u_dot", "u̇", "accelerations of the inputs at order 2, per second", "Nm", "inputs", since=8,
        noted=True, optional=True,
        curve=Curve("accelerations", "Accelerations of the inputs", 12),
    ),
    RecordedQuantity("q_dot", "q̇", "S(q) u, per second", "Nn", "coordinates", noted=True, finite=True),
    RecordedQuantity("r", "r", "value of the task", "Ns", "rows", noted=True, column="r_{}"),
    RecordedQuantity("r_d", "r_d", "target of the task", "Ns", "rows", noted=True, column="r_d_{}"),
    RecordedQuantity(
        "error_norm", "‖e‖", "norm of the task error", "N", "rows", saved=False, of=error_norm,
        curve=Curve("error", "Task error", 1, log="always", opens_below=np.inf),
        numbers=(
            Number("error_initial", lambda t, x: x[0], about="‖e‖ at the start, rows in m and rad"),
            Number(
                "error_final", lambda t, x: x[-1], "‖e‖, at the end", r"$\|e\|$, at the end", "‖e‖ at the end"
            ),
            Number(
                "error_max_second_half", lambda t, x: _late(t, x).max(),
                about="largest ‖e‖ of the second half",
            ),
            Number("error_rms", lambda t, x: rms(x), "‖e‖, RMS", r"$\|e\|$, RMS", "root mean square of ‖e‖"),
            Number("error_max", lambda t, x: x.max(), "‖e‖, largest", r"$\|e\|$, largest", "largest ‖e‖"),
        ),
    ),
    RecordedQuantity(
        "error", "e", "task error, angles wrapped", "Ns", "rows", noted=True, column="error_{}",
        curve=Curve("components", "Components of the task error", 8),
    ),
    RecordedQuantity(
        "objective", "H", "objective H(q)", fill=0.0, noted=True, bounded=False, column="objective",
        curve=Curve("H", "Objective", 2, log="positive", opens_below=np.inf),
        numbers=(
            Number(
                "objective_initial", lambda t, x: x[0],
                "H, at the start", "$H$, at the start", "H at the start",
            ),
            Number("objective_final", lambda t, x: x[-1], "H, at the end", "$H$, at the end", "H at the end"),
            Number(
                "objective_mean_second_half", lambda t, x: _late(t, x).mean(),
                "H, mean of 2nd half", "$H$, mean of 2nd half", "mean H of the second half",
            ),
            Number(
                "objective_max_second_half", lambda t, x: _late(t, x).max(),
                about="largest H of the second half",
            ),
            Number(
                "objective_integral", lambda t, x: np.trapezoid(x, t),
                "∫ H dt", r"$\int H\,dt$", "∫ H dt", "s",
            ),
        ),
    ),
    RecordedQuantity(
        "sigma_min", "σ_min", "smallest singular value of J̄", column="sigma_min",
        of=lambda record: np.asarray(spectra(record["J"], threads=1)[:, -1]),
        curve=Curve("sigma", "Smallest singular value of J", 3, opens_below=np.inf),
        numbers=(
            Number(
                "sigma_min", lambda t, x: x.min(),
                "σ_min, least", r"$\sigma_{\min}$, least", "least singular value of J", "mixed",
            ),
        ),
    ),
    RecordedQuantity(
        "partition", "Ja", "columns of Ja (RG), -1 elsewhere", "Ns", whole=True, fill=-1, noted=True,
        counts=("m", "columns of the inputs"), column="partition_{}",
        curve=Curve("partition", "Partition: the inputs in Ja", 6),
    ),
    RecordedQuantity(
        "residual", "‖J u − rate‖", "by how much J u missed the rate", noted=True, column="residual",
        curve=Curve("residual", "Residual", 11, log="always"),
        numbers=(Number("residual_max", lambda t, x: x.max(), about="largest ‖J u - rate‖"),),
    ),
    RecordedQuantity(
        "scale", "λ", "share of the task's rate that limits left", "Nl", fill=1.0, since=2, noted=True,
        column="scale_{}",
        curve=Curve(
            "scale", "Share of the task's rate that limits left", 4, if_true="limited", opens_below=1.0
        ),
        numbers=(
            Number(
                "scale_min", lambda t, x: x.min(), "λ, least", r"$\lambda$, least",
                "least λ: the share of the task's rate that limits left",
            ),
            Number(
                "scaled_share", lambda t, x: np.mean(np.any(x < 1.0, axis=1)),
                "time with λ < 1, share", r"time with $\lambda < 1$, share", "share of the time with λ < 1",
            ),
        ),
    ),
    RecordedQuantity(
        "margin", "margin", "least distance to a limit, as a share of its range", fill=np.inf, since=3,
        column="margin", place=1,
        curve=Curve("margin", "Limits", 5, text="least margin", lower=0.0, exact=1e-9, opens_below=0.05),
        numbers=(
            Number(
                "margin_min", lambda t, x: x.min() if np.isfinite(x).all() else None,
                "margin to limits, least (share)", about="least distance to a limit, as a share of its range",
            ),
        ),
    ),
    RecordedQuantity(
        "step_size", "α", "share of α that was taken", fill=1.0, since=5, noted=True, column="step_size",
        numbers=(
            Number("step_size_min", lambda t, x: x.min(), about="least share of α that was taken"),
            Number("step_size_mean", lambda t, x: x.mean()),
        ),
        line=("share of α taken", "{step_size_mean:.3g}, {step_size_min:.3g} at least"),
    ),
    RecordedQuantity(
        "crossed", "", "1 where J_e was singular on the way from the sample before, else 0", whole=True,
        fill=0, since=7,
    ),
    RecordedQuantity(
        "shares", "", "where each limit's quantity is in its range, 0 at the lower limit, 1 at the upper",
        "NL", since=4,
    ),
    RecordedQuantity(
        "clearance", "clearance", "least distance of what is kept apart", "K", "m", fill=np.inf, since=6,
        curve=Curve("clearance", "Collisions", 10, lower="clearance_asked"),
    ),
    RecordedQuantity(
        "clearance_between", "", "least clearance on the way to the next sample", "K", "m", fill=np.inf,
        since=6, place=-1,
        numbers=(
            Number(
                "clearance_min", lambda t, x: x.min() if np.isfinite(x).any() else None,
                "clearance, least", about="least distance of what is kept apart",
            ),
            Number("clearance_min_t", lambda t, x: t[np.argmin(x)]),
        ),
    ),
    RecordedQuantity(
        "clearance_pairs", "", "which pair is nearest, -1 for none", "K", whole=True, fill=-1, since=6,
        counts=("p", "places among the names"),
    ),
    RecordedQuantity("clearance_points", "", "the two nearest points, in the world", "K6", "m", since=6),
    RecordedQuantity("path", "", "the end-effector's path", "N3", "m", optional=True, finite=True),
    RecordedQuantity("desired", "", "its desired path", "N3", "m", optional=True),
    RecordedQuantity("planned", "", "where its plan was", "Nn", "coordinates", optional=True, finite=True),
    RecordedQuantity(
        "believed", "", "where it is believed to be", "Nn", "coordinates", since=9, optional=True, finite=True
    ),
    RecordedQuantity("target", "", "the point that a bearing looks at", "3", "m", optional=True, finite=True),
    RecordedQuantity("seen", "", "the points that cameras see", "NP3", "m", since=9, optional=True),
    RecordedQuantity("rate", "ṙ_d + K e", "rate that the task asks for", "Ns", noted=True, saved=False),
    RecordedQuantity("J", "J̄", "matrix of the task", "Nsm", noted=True, saved=False),
    RecordedQuantity(
        "added_residual", "", "by how much the added task missed its rate", fill=0.0, noted=True, saved=False
    ),
    RecordedQuantity("excess", "", "by how much limits were widened", fill=0.0, noted=True, saved=False),
    RecordedQuantity(
        "side", "sign det J_e", "where the extended Jacobian inverted it, else 0", whole=True, fill=0,
        noted=True, saved=False,
    ),
    RecordedQuantity(
        "unanswered", "", "1 where the resolver had no answer", whole=True, fill=0, noted=True, saved=False
    ),
    RecordedQuantity("limited", "", "values that limits are about", "Nw", noted=True, saved=False),
    RecordedQuantity(
        "lateral_slip", "", "how much the wheels' constraints are violated: the largest |A(qp) qp_dot|",
        unit="m/s", saved=False, of=lateral_slip, place=2,
        numbers=(
            Number(
                "lateral_slip_max", lambda t, x: x.max(),
                "lateral slip, largest", about="largest slip of the wheels",
            ),
        ),
    ),
    RecordedQuantity(
        "drift", "drift", "distance of the platform from where it is believed to be", unit="m", saved=False,
        of=drift, place=2,
        curve=Curve("drift", "Believed pose", 4, opens_below=np.inf),
        numbers=(
            Number(
                "drift", lambda t, x: x[-1], "drift, at the end",
                about="distance of the platform from where it is believed to be, at the end",
            ),
            Number(
                "drift_max", lambda t, x: x.max(), "drift, largest",
                about="largest distance of the platform from where it is believed to be",
            ),
        ),
        line=("drift of the believed pose", "{drift:.3g} m at the end, {drift_max:.3g} m at most"),
    ),
    RecordedQuantity(
        "sliding", "", "speed of the wheel that slides fastest by design", unit="m/s", saved=False, place=2,
        of=lambda record: record.robot.platform.sliding(record["u"][:, : record.robot.platform.p]),
        numbers=(Number("sliding_max", lambda t, x: x.max(), "designed sliding, largest"),),
    ),
    RecordedQuantity(
        "partition_changes", "", "1 where RG has another partition than at the sample before, else 0",
        whole=True, fill=0, saved=False, of=partition_changes, place=2,
        numbers=(
            Number(
                "partition_switches", lambda t, x: x.sum(),
                "switches of partition", about="how often RG changed its partition",
            ),
        ),
    ),
    RecordedQuantity(
        "input_norm", "‖u‖", "norm of the inputs", unit="inputs", saved=False, place=2,
        of=lambda record: np.asarray(np.linalg.norm(record["u"], axis=1)),
        numbers=(
            Number("input_rms", lambda t, x: rms(x), "‖u‖, RMS", r"$\|u\|$, RMS", "root mean square of ‖u‖"),
            Number("input_peak", lambda t, x: x.max(), "‖u‖, largest", r"$\|u\|$, largest", "largest ‖u‖"),
        ),
    ),
)  # fmt: skip

#: By name. trajectory.npz holds the saved ones in this order, optional ones last.
QUANTITIES: dict[str, RecordedQuantity] = {quantity.name: quantity for quantity in _TABLE}


def saved() -> list[RecordedQuantity]:
    """Those of the trajectory, in its file's order."""
    quantities = [quantity for quantity in QUANTITIES.values() if quantity.saved]
    return sorted(quantities, key=lambda quantity: quantity.optional)


def placed() -> list[RecordedQuantity]:
    """All, in the order of columns and summaries."""
    return sorted(QUANTITIES.values(), key=lambda quantity: quantity.place)


def named_numbers() -> list[tuple[str, Number]]:
    """The numbers of quantities that tables of runs show, each with its unit."""
    return [
        (number.unit or quantity.unit, number)
        for quantity in placed()
        for number in quantity.numbers
        if number.name
    ]
