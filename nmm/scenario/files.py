"""Files that a scenario names: text until it is known where the scenario stands, then absolute paths."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator

from nmm.base.errors import InputError
from nmm.base.files import named_folder
from nmm.scenario.keys import KeyedPart
from nmm.scenario.yaml_text import Place

#: The absolute path of a file that is named at a place of the scenario.
Absolute = Callable[[str, Place], Path]
P = TypeVar("P", bound=KeyedPart)

PACKAGE = "package://"


class _Named(str):
    """A file as it is written; `package` where NAME=FOLDER may stand."""

    package = False

    def whole(self, absolute: Absolute, place: Place) -> str:
        name, folder = named_folder(self) if self.package else ("", self)
        return f"{name}{'=' if name else ''}{absolute(folder, place)}"


class _NamedFolder(_Named):
    package = True


def readable(value: object) -> object:
    if isinstance(value, str) and (not value.strip() or "\0" in value):
        raise InputError(expected="a name or a path", got=value)
    return value


def file_or_package(text: str) -> str:
    return text if text.startswith(PACKAGE) else _Named(text)


FileName = Annotated[str, AfterValidator(file_or_package), BeforeValidator(readable)]
NamedFolder = Annotated[str, AfterValidator(_NamedFolder), BeforeValidator(readable)]


def with_files(part: P, absolute: Absolute, place: Place = ()) -> P:
    """The part at a place of the scenario, with absolute paths in it and in the parts below."""

    def whole(value: Any, place: Place) -> Any:
        if isinstance(value, KeyedPart):
            return with_files(value, absolute, place)
        if isinstance(value, list):
            return [whole(item, (*place, i)) for i, item in enumerate(value)]
        return value.whole(absolute, place) if isinstance(value, _Named) else value

    return part.model_copy(update={key: whole(value, (*place, key)) for key, value in part})
