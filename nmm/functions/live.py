"""Numbers of a stage that are set from outside, while programs that read them are in use."""

from __future__ import annotations

import weakref
from threading import Lock

from nmm.arrays import Array


class LiveNumbers:
    """An array that, when it is set, is written wherever compiled code reads it, so that steps need not ask.

    Its readers are held weakly. A copy or a pickle takes the numbers along, not the readers.

    Attributes
    ----------
    numbers : what they are now; set as a whole, never written into, so that whoever looks sees one state

    Examples
    --------
    >>> live, read = nmm.LiveNumbers(np.array([1.0, 2.0])), np.zeros(2)
    >>> live.read_by(read)
    >>> live.set(np.array([3.0, 4.0]))
    >>> read
    array([3., 4.])
    """

    def __init__(self, numbers: Array) -> None:
        self.numbers = numbers
        self._readers: list[weakref.ref[Array]] = []
        self._lock = Lock()

    def read_by(self, block: Array) -> None:
        """Write them to `block`, now and whenever they are set, for as long as someone else holds it."""
        with self._lock:
            self._readers = [reader for reader in self._readers if reader() is not None]
            self._readers.append(weakref.ref(block))
            block[:] = self.numbers

    def set(self, numbers: Array) -> None:
        """Other numbers, as many, from the next step on of every program that reads them."""
        with self._lock:
            self.numbers = numbers
            for reader in self._readers:
                block = reader()
                if block is not None:
                    block[:] = numbers  # in one go: numpy holds the interpreter's lock for so few

    def __reduce__(self) -> tuple[object, ...]:
        return LiveNumbers, (self.numbers.copy(),)
