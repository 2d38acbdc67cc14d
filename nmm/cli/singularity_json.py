"""The numbers of a singularity analysis for scripts: what `nmm singularities --json` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nmm.analysis import Crossing, Dip, Restoration, SingularityHistory, SingularityReport
    from nmm.cli.subjects import Studied


def report_data(given: Studied, report: SingularityReport) -> dict[str, Any]:
    """A report; minors by "v, omega", what is infinite or undefined as null."""
    found, extended = report.partitions, report.extended
    return _plain(
        {
            **_subject(given),
            "t": report.t,
            "q": dict(zip(given.robot.q_names, report.q, strict=True)),
            "rows": report.rows,
            "row_units": report.row_units,
            "row_sizes": report.row_sizes,
            "inputs": report.inputs,
            "input_units": report.input_units,
            "input_sizes": report.input_sizes,
            "J": report.J,
            "rank": report.rank,
            "singular": report.singular,
            "singular_values": report.singular_values,
            "sigma_min": report.sigma_min,
            "condition": report.condition,
            "parts": {
                name: {
                    "inputs": part.inputs,
                    "rank": part.rank,
                    "singular_values": part.singular_values,
                    "sigma_min": part.sigma_min,
                    "condition": part.condition,
                    "lost": part.lost,
                }
                for name, part in report.parts.items()
            },
            "lost": report.lost,
            "weakest": report.weakest,
            "given_back": report.given_back,
            "by_input": _restoration(report.by_input),
            "by_coordinate": _restoration(report.by_coordinate),
            "minors": {", ".join(name): value for name, value in report.minors.items()},
            "partitions": [
                {"inputs": name, "determinant": value, "ratio": ratio, "singular": bool(lost)}
                for name, value, ratio, lost in zip(
                    found.names, found.determinants, found.ratios, found.singular, strict=True
                )
            ],
            "extended": None
            if extended is None
            else {
                "rows": extended.rows,
                "determinant": extended.determinant,
                "rank": extended.rank,
                "singular_values": extended.singular_values,
                "angle_measure": extended.angle_measure,
                "lost": extended.lost,
                "kinematic": extended.kinematic,
                "algorithmic": extended.algorithmic,
                "constraint_singular": extended.added_singular,
            },
        }
    )


def history_data(given: Studied, history: SingularityHistory) -> dict[str, Any]:
    """A history; what is infinite or undefined as null."""
    return _plain(
        {
            **_subject(given),
            "rows": history.rows,
            "inputs": history.inputs,
            "t": history.t,
            "rank": history.rank,
            "condition": history.condition,
            "sigma_min": dict(history.sigma_min),
            "extended_sigma_min": history.extended_sigma_min,
            "minors": {", ".join(name): values for name, values in history.minors.items()},
            "threshold": history.threshold,
            "crossings": [_crossing(crossing) for crossing in history.crossings],
            "dips": [_dip(dip) for dip in history.dips],
            "extended_dips": [_dip(dip) for dip in history.extended_dips],
        }
    )


def _subject(given: Studied) -> dict[str, Any]:
    return {"name": given.name, "robot": given.robot.name, "platform": given.robot.platform.name}


def _restoration(found: Restoration) -> dict[str, Any]:
    return {
        "names": found.names,
        "rates": found.rates,
        "regained": found.regained,
        "effective": found.effective,
        "best": found.best,
        "best_rate": found.best_rate,
    }


def _crossing(crossing: Crossing) -> dict[str, Any]:
    return {"t": crossing.t, "columns": crossing.columns, "sign": crossing.sign}


def _dip(dip: Dip) -> dict[str, Any]:
    return {"t": dip.t, "value": dip.value, "at_end": dip.at_end}


def _plain(value: Any) -> Any:
    """Arrays and tuples as lists, numpy's numbers as Python's, infinity and NaN as None."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
