"""Obstacles that a sensor sees again while they are in use."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import RLock, Thread
from typing import Any, TypeAlias

import numpy as np

from nmm.base.errors import InputError
from nmm.base.text_format import one_line
from nmm.model.collisions.elements.boxes import Elements
from nmm.model.collisions.obstacle import Obstacle, Placement

#: What is set at once: attributes by their names, `shape` among them.
Attributes: TypeAlias = dict[str, Any]
#: Where the one element is of what is seen empty, m below the middle of what was seen last.
AWAY = 1000.0
#: One for all, which are copied and sent to processes.
_UPDATING = RLock()


class SensedObstacle(Obstacle):
    """An obstacle of points or cells, which a background thread may make anew."""

    def __init__(self, shape: Elements, placement: Placement | None, name: str) -> None:
        super().__init__(shape, placement, name=name)
        self._blank = False
        self._waiting: Callable[[], Attributes] | None = None
        self._worker: Thread | None = None
        self._fault: InputError | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Copies have what is in place; what is being made stays here."""
        return {**vars(self), "_waiting": None, "_worker": None, "_fault": None}

    @property
    def _elements(self) -> Elements:
        """Its points or cells as a shape."""
        shape: Any = self.shape
        return shape

    @property
    def blank(self) -> bool:
        """Whether nothing is seen of it."""
        return self._blank

    def _renew(self, wait: bool, make: Callable[..., Attributes], *arguments: Any) -> None:
        """Set what `make` returns, in the background. Raises what an earlier call's `make` raised, and where
        it waits its own."""
        with _UPDATING:
            fault, self._fault = self._fault, None
            self._waiting = partial(make, *arguments)
            if self._worker is None:
                self._worker = Thread(target=self._work, name=f"nmm {self.name}", daemon=True)
                self._worker.start()
            worker = self._worker
        if wait:
            worker.join()
            with _UPDATING:
                fault, self._fault = self._fault or fault, None
        if fault is not None:
            raise fault

    def _work(self) -> None:
        """Make what waits, until nothing does."""
        while True:
            with _UPDATING:
                make, self._waiting = self._waiting, None
                if make is None:
                    self._worker = None
                    return
            try:
                made = make()
                _ = made["shape"].cells, made["shape"].box  # before anybody asks for them
            except Exception as error:  # told by the next call: nothing else sees this thread
                fault = error if isinstance(error, InputError) else InputError(one_line(str(error)))
                with _UPDATING:
                    self._fault = fault
            else:
                vars(self).update(made)

    def _seen(self, shape: Elements | None, **attributes: Any) -> Attributes:
        """What is set with a shape; None where nothing is seen: then a point so far below that nothing is
        near it."""
        blank = shape is None
        if blank and not self._blank:
            low, high = self._elements.box
            below = self.at(0.0).rotation.T @ np.array([0.0, 0.0, -AWAY])
            shape = Elements([0.5 * (low + high) + below], radius=self._elements.radius)
        return {**attributes, "shape": self._elements if shape is None else shape, "_blank": blank}
