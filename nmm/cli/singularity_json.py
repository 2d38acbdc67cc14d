"""The numbers of a singularity analysis for scripts: what `nmm singularities --json` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nmm.analysis import SingularityHistory, SingularityReport
    from nmm.cli.subjects import Studied


def report_data(given: Studied, report: SingularityReport) -> dict[str, Any]:
    """A report; minors by "v, omega", what is infinite or undefined as null."""
    found, extended = report.partitions, report.extended
    return _plain(
        {
            **_subject(given),
            **_fields(report, "t"),
            "q": dict(zip(given.robot.q_names, report.q, strict=True)),
            **_fields(report, "rows row_units row_sizes inputs input_units input_sizes J rank singular"),
            **_fields(report, "singular_values sigma_min condition"),
            "parts": {
                name: _fields(part, "inputs rank singular_values sigma_min condition lost")
                for name, part in report.parts.items()
            },
            **_fields(report, "lost weakest given_back"),
            "by_input": _fields(report.by_input, "names rates regained effective best best_rate"),
            "by_coordinate": _fields(report.by_coordinate, "names rates regained effective best best_rate"),
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
                **_fields(extended, "rows determinant rank singular_values angle_measure lost kinematic"),
                **_fields(extended, "algorithmic"),
                "constraint_singular": extended.added_singular,
            },
        }
    )


def history_data(given: Studied, history: SingularityHistory) -> dict[str, Any]:
    """A history; what is infinite or undefined as null."""
    return _plain(
        {
            **_subject(given),
            **_fields(history, "rows inputs t rank condition"),
            "sigma_min": dict(history.sigma_min),
            "extended_sigma_min": history.extended_sigma_min,
            "minors": {", ".join(name): values for name, values in history.minors.items()},
            "threshold": history.threshold,
            "crossings": [_fields(crossing, "t columns sign") for crossing in history.crossings],
            "dips": [_fields(dip, "t value at_end") for dip in history.dips],
            "extended_dips": [_fields(dip, "t value at_end") for dip in history.extended_dips],
        }
    )


def _subject(given: Studied) -> dict[str, Any]:
    return {"name": given.name, "robot": given.robot.name, "platform": given.robot.platform.name}


def _fields(found: object, names: str) -> dict[str, Any]:
    """Some fields, under their own names."""
    return {name: getattr(found, name) for name in names.split()}


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
