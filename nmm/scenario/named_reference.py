"""A task's reference named by its path in the place of another: `of: task.0.reference`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from typing import Any

from pydantic import ValidationInfo

from nmm.errors import unknown

_PATH = re.compile(r"task(\.\w+)+")


def is_path(value: object) -> bool:
    """Whether a text is meant as a path to a task's reference: no number is, and no frame is called so."""
    return isinstance(value, str) and _PATH.fullmatch(value.strip()) is not None


class NamedReferences:
    """The references of a scenario's tasks by their paths; what validators get as their context.

    Parameters
    ----------
    data : the scenario as plain data
    """

    def __init__(self, data: Mapping[str, Any]) -> None:
        tasks = data.get("task")
        listed = {"task": tasks} if isinstance(tasks, Mapping) else {}
        # A task that is written without the list is the list's only one, too.
        numbered = tasks if isinstance(tasks, list) else listed.values()
        listed |= {f"task.{i}": task for i, task in enumerate(numbered)}
        self._references = {
            f"{name}.reference": task["reference"]
            for name, task in listed.items()
            if isinstance(task, Mapping) and "reference" in task
        }
        self._open: list[str] = []

    @contextmanager
    def followed(self, path: str) -> Iterator[Any]:
        """What is written at a path; `ValueError` where nothing is, and in a circle."""
        if path not in self._references:
            raise ValueError(unknown("reference", path, self._references))
        if path in self._open:
            circle = " → ".join([*self._open[self._open.index(path) :], path])
            raise ValueError(f"expected a reference that does not lead back to itself, got {circle}")
        self._open.append(path)
        try:
            yield deepcopy(self._references[path])  # the same object again is a circle to pydantic, unnamed
        finally:
            self._open.pop()


def references_of(info: ValidationInfo) -> NamedReferences:
    """Those of the scenario that is being checked; a part that is checked alone has none."""
    return info.context if isinstance(info.context, NamedReferences) else NamedReferences({})
