"""What plugins have going on beside a run: what fails there is told when the run is written."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from nmm.base.errors import NmmError
from nmm.base.plugins import Beside


class GuardedBeside(Beside):
    """Passes on what it is told, and keeps what fails then: neither a run nor what it computed is lost by it.
    What failed is told nothing more of the run's samples.

    Attributes
    ----------
    faults : what failed, in words
    """

    def __init__(self, own: Beside) -> None:
        self._own = own
        self.faults: list[str] = []

    @contextmanager
    def kept(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # a plugin's may be of any kind
            told = isinstance(error, NmmError | OSError)
            text = str(error) if told else f"{type(error).__name__}: {error}"
            if text not in self.faults:
                self.faults.append(text)

    def watch(self, recorder: Any) -> None:
        if not self.faults:
            with self.kept():
                self._own.watch(recorder)

    def end(self, run: Any, asked: bool) -> None:
        with self.kept():
            self._own.end(run, asked)


@contextmanager
def guarded(context: AbstractContextManager[Beside]) -> Iterator[GuardedBeside]:
    """What the context gives, which fails only before there is a run."""
    made = GuardedBeside(context.__enter__())
    try:
        yield made
    finally:
        broke_off = sys.exc_info()
        with made.kept():
            context.__exit__(*broke_off)
