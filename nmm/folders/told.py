"""What the JSON of a folder says, with the keys and the kinds of values that it must have."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, FiniteFloat, PositiveFloat, ValidationError

from nmm.errors import InputError
from nmm.files import read_bytes
from nmm.folders.whole import MOST
from nmm.runs.residuals import NONE
from nmm.runs.trajectory import Outcome
from nmm.scenario.keys import first_error
from nmm.scenario.yaml_text import dotted


class Told(BaseModel):
    """A mapping of a folder's JSON; keys that only people read are left out."""

    model_config = ConfigDict(strict=True, frozen=True)


class ToldRobot(Told):
    """Which robot it was."""

    name: str
    source: str
    arguments: dict[str, str]
    fingerprint: str | None = None


class ToldEvent(Told):
    """As `nmm.control.sequence.Event`."""

    t: FiniteFloat
    task: str
    what: str
    why: str


class ToldObstacle(Told):
    """As `nmm.collisions.recorded.described`."""

    name: str
    shape: dict[str, Any]


class ToldRun(Told):
    """summary.json of a run; what has a value here, older ones lack."""

    format: str
    robot: ToldRobot
    r_names: tuple[str, ...]
    r_units: tuple[str, ...]
    resolver: str
    method: str
    dt: PositiveFloat
    outcome: Outcome
    message: str
    warnings: tuple[str, ...]
    frame: str | None
    samples: int | None = None
    label: str = ""
    limited: bool = False
    kinematics_off: float | None = None
    limit_names: tuple[str, ...] = ()
    clearance_names: tuple[str, ...] = ()
    clearance_asked: FiniteFloat = 0.0
    obstacles: tuple[ToldObstacle, ...] | None = None
    events: tuple[ToldEvent, ...] = ()
    made_with: dict[str, str | int] = {}
    unmet_samples: int = NONE.samples
    unmet_share: float = NONE.share
    unmet_largest: float = NONE.largest
    unmet_relative: float = NONE.relative
    unmet_t: float = NONE.t


class ToldComparison(Told):
    """summary.json of a comparison: its runs, by the names of their folders."""

    format: str
    runs: dict[str, Any]


class ToldFormat(Told):
    """What any of them says."""

    format: str


Kind = TypeVar("Kind", bound=Told)


def read_told(path: Path, kind: type[Kind], format_: str) -> Kind:
    """What a JSON file says; `InputError` names the file, the key, and what was expected there."""
    try:
        content = read_bytes(path, MOST)
    except FileNotFoundError:
        raise InputError(f"{path}: this file is missing") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    said = _checked(path, content, ToldFormat).format
    if said != format_:
        raise InputError(f"{path}: format: expected {format_!r}, got {said!r}{_newer(said, format_)}")
    return _checked(path, content, kind)


def _checked(path: Path, content: bytes, kind: type[Kind]) -> Kind:
    try:
        return kind.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        if first["type"] == "json_invalid":
            raise InputError(f"{path}: not valid JSON: {first['ctx']['error']}") from None
        wrong = first_error(error, {})
        place = f"{dotted(wrong.place)}: " if wrong.place else ""
        raise InputError(f"{path}: {place}{wrong.text}") from None


def _newer(said: str, ours: str) -> str:
    kind = ours.rpartition(" ")[0]
    return " (written by another version of nmm)" if said.rpartition(" ")[0] == kind else ""
