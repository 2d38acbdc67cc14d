"""What a sweep is: a scenario, what varies in it, how that is sampled; and the settings of each row."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

from nmm.scenario.document import Document
from nmm.sweeps.sampling import SAMPLERS
from nmm.sweeps.varied import Listed, Range, Varied

#: What may be kept of each rollout beside its row.
KEPT = ("trajectories", "playback")
#: Rows of a chunk, at least and at most: what is computed and written at a time, and lost at a kill.
SMALLEST, LARGEST = 8, 1024
#: Into so many chunks a sweep of middling size falls.
CHUNKS = 256


@dataclass(frozen=True)
class Definition:
    """All that its rows depend on; any process makes the same row of the same number of it.

    Points of the ranges are sampled; each is run with every combination of the values that are listed. Row i
    is combination i mod K at point i div K, of K combinations.

    Attributes
    ----------
    name, title : of the sweep
    scenario : a bundled name or a file's absolute path, as `nmm run` takes it
    settings : values set in it before anything varies, by dotted key
    document : the scenario's text, with the settings
    keys : every key of it, as `Scenario.resolved` has them
    vary : what varies, in the order of the columns
    samples : points of the ranges; 1 without any
    sampler : one of `sampling.SAMPLERS`, or "grid"
    seed : of the sampler
    keep : None, "trajectories" (run folders) or "playback" (run folders with playback.html)
    robot : the fingerprint of the scenario's robot before anything varies
    inputs : the names of its inputs
    version : of nmm
    """

    name: str
    title: str
    scenario: str
    settings: dict[str, Any]
    document: Document
    keys: dict[str, Any]
    vary: tuple[Varied, ...]
    samples: int
    sampler: str
    seed: int
    keep: str | None
    robot: str
    inputs: tuple[str, ...]
    version: str

    @property
    def ranges(self) -> list[Range]:
        """What is sampled."""
        return [one for one in self.vary if isinstance(one, Range)]

    @property
    def listed(self) -> list[Listed]:
        """What is combined."""
        return [one for one in self.vary if isinstance(one, Listed)]

    @property
    def combinations(self) -> int:
        """K, of the values that are listed; 1 without any."""
        return prod(len(one.values) for one in self.listed)

    @property
    def rows(self) -> int:
        """How many rollouts."""
        return self.samples * self.combinations

    @property
    def chunk(self) -> int:
        """Rows of a chunk."""
        largest = SMALLEST if self.keep else LARGEST
        return min(max(self.rows // CHUNKS, SMALLEST), largest)

    @property
    def chunks(self) -> int:
        """How many chunks; the last may be smaller."""
        return -(-self.rows // self.chunk)

    def indices(self, chunk: int) -> range:
        """The rows of a chunk."""
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, self.rows))

    def changes(self, indices: Sequence[int]) -> list[dict[str, Any]]:
        """What is set in the scenario for each of these rows, by key in the order of `vary`.

        They depend on the definition and the row's number alone.
        """
        return [{key: given for key, (given, _) in row.items()} for row in self._cells(indices)]

    def parameters(self, indices: Sequence[int]) -> list[dict[str, float | str]]:
        """The same as a table holds it."""
        return [{key: told for key, (_, told) in row.items()} for row in self._cells(indices)]

    def _cells(self, indices: Sequence[int]) -> list[dict[str, tuple[Any, float | str]]]:
        """By key what is set and what is told."""
        if not len(indices):
            return []
        first, last = min(indices) // self.combinations, max(indices) // self.combinations
        sampled: dict[str, list[float]] = {}
        if self.ranges:
            shares = SAMPLERS[self.sampler](
                self.seed, self.samples, len(self.ranges), first, last - first + 1
            )
            sampled = {one.key: one.at(shares[:, k]).tolist() for k, one in enumerate(self.ranges)}
        rows = []
        for index in indices:
            point, rest = divmod(index, self.combinations)
            row: dict[str, tuple[Any, float | str]] = {
                key: (values[point - first], values[point - first]) for key, values in sampled.items()
            }
            for one in reversed(self.listed):  # the last one changes fastest
                rest, k = divmod(rest, len(one.values))
                row[one.key] = one.values[k], one.told[k]
            rows.append({one.key: row[one.key] for one in self.vary})
        return rows

    def plain(self) -> dict[str, Any]:
        """What makes it this sweep and no other, as JSON holds it."""
        content = {
            "nmm": self.version,
            "scenario": self.scenario,
            "keys": self.keys,
            "robot": self.robot,
            "vary": {one.key: {k: v for k, v in one.plain().items() if k != "key"} for one in self.vary},
            "samples": self.samples,
            "sampler": self.sampler,
            "seed": self.seed,
            "keep": self.keep,
        }
        return json.loads(json.dumps(content, default=str))

    @cached_property
    def digest(self) -> str:
        """Of all that, and where the scenario's files are."""
        text = json.dumps([self.plain(), str(self.document.folder)])
        return hashlib.sha256(text.encode()).hexdigest()

    def command(self, index: int) -> list[str]:
        """The words of the command line that runs row `index` alone."""
        (changes,) = self.changes([index])
        words = ["nmm", "run", self.scenario]
        for key, value in {**self.settings, **changes}.items():
            words += ["--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}"]
        return words
