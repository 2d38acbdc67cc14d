"""What a sweep is: a scenario, what varies in it and whether it can, how that is sampled; and each row's
settings."""

import hashlib
import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice, product
from math import prod
from numbers import Real
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect
from nmm.base.text_format import split_outside_brackets
from nmm.scenario import Scenario
from nmm.scenario.document import Document
from nmm.scenario.numbers import evaluate, number

#: What may be kept of a rollout besides its row.
KEPT = ("trajectories", "playback")
#: Rows of a chunk, at least and at most: computed and written at a time, and lost if killed.
SMALLEST, LARGEST = 8, 1024
#: Chunks of a medium-sized sweep.
CHUNKS = 256
#: A Latin hypercube's points at most: each process makes and holds all of them.
MOST_OF_A_HYPERCUBE = 10_000_000
#: Points of SciPy's Sobol sequence by default.
MOST_OF_SOBOL = 2**30
#: The sampler of sweeps without ranges: nothing is sampled.
GRID = "grid"
EXPECTED = "LOWER:UPPER, LOWER:UPPER:COUNT or VALUE,VALUE,..., as in -pi:pi or rg,pg"
#: The most values of one key that are listed one by one.
MOST_VALUES = 100_000
#: Where a range is tried, its middle first.
SHARES = (0.5, 0.0, 1.0, 0.25, 0.75)
#: Combinations of other keys' values tried with a value that is invalid alone.
MOST_COMBINATIONS = 32


@dataclass(frozen=True)
class Range:
    """A dotted key sampled between two numbers, in the scenario's unit."""

    key: str
    lower: float
    upper: float

    def at(self, shares: Array) -> Array:
        """Values (N,) at shares of the range in [0, 1)."""
        return self.lower + (self.upper - self.lower) * shares

    def plain(self) -> dict[str, Any]:
        return {"lower": self.lower, "upper": self.upper}


@dataclass(frozen=True)
class Listed:
    """A dotted key that takes each of several values, as a scenario takes them, with all of the others."""

    key: str
    values: tuple[Any, ...]

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The values, if each is a number or arithmetic."""
        try:
            return tuple(number(value) for value in self.values)
        except ValueError:
            return None

    @property
    def cells(self) -> tuple[float | str, ...]:
        """The values in a table: numbers if all of them are, otherwise text."""
        return self.numbers or tuple(
            value if isinstance(value, str) else json.dumps(value) for value in self.values
        )

    def plain(self) -> dict[str, Any]:
        return {"values": list(self.values)}


Varied = Range | Listed


@dataclass(frozen=True)
class Definition:
    """All that a sweep's rows depend on; any process makes the same row of the same number.

    Row i is number i mod K of the listed values' K combinations, at point i div K of the sampled ranges.
    scenario : a bundled name or a file's absolute path, as `nmm run` takes it
    settings, document, keys : values set before anything varies, by dotted key; the text with them; all keys
    vary : what varies, in the columns' order
    samples, sampler, seed : points of the ranges (1 without any), and one of `SAMPLERS`, or "grid"
    keep : None, "trajectories" (run folders) or "playback" (run folders with playback.html)
    robot, inputs : fingerprint and input names of the robot before anything varies
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
        return [axis for axis in self.vary if isinstance(axis, Range)]

    @property
    def listed(self) -> list[Listed]:
        return [axis for axis in self.vary if isinstance(axis, Listed)]

    @property
    def combinations(self) -> int:
        """K, the number of combinations of the listed values; 1 without any."""
        return prod(len(axis.values) for axis in self.listed)

    @property
    def rows(self) -> int:
        return self.samples * self.combinations

    @property
    def chunk(self) -> int:
        largest = SMALLEST if self.keep else LARGEST
        return min(max(self.rows // CHUNKS, SMALLEST), largest)

    @property
    def chunks(self) -> int:
        return -(-self.rows // self.chunk)

    def indices(self, chunk: int) -> range:
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, self.rows))

    def changes(self, indices: Sequence[int]) -> list[dict[str, Any]]:
        """What each of these rows sets in the scenario, by key in the order of `vary`."""
        return [{key: value for key, (value, _) in row.items()} for row in self._cells(indices)]

    def parameters(self, indices: Sequence[int]) -> list[dict[str, float | str]]:
        """The same, as the table's cells."""
        return [{key: cell for key, (_, cell) in row.items()} for row in self._cells(indices)]

    def _cells(self, indices: Sequence[int]) -> list[dict[str, tuple[Any, float | str]]]:
        """By key, the value to set and the table's cell."""
        if not len(indices):
            return []
        first, last = min(indices) // self.combinations, max(indices) // self.combinations
        sampled: dict[str, list[float]] = {}
        if self.ranges:
            sample = SAMPLERS[self.sampler]
            shares = sample(self.seed, self.samples, len(self.ranges), first, last - first + 1)
            sampled = {axis.key: axis.at(shares[:, k]).tolist() for k, axis in enumerate(self.ranges)}
        rows = []
        for index in indices:
            point, rest = divmod(index, self.combinations)
            row: dict[str, tuple[Any, float | str]] = {
                key: (values[point - first], values[point - first]) for key, values in sampled.items()
            }
            for axis in reversed(self.listed):  # the last one changes fastest
                rest, k = divmod(rest, len(axis.values))
                row[axis.key] = axis.values[k], axis.cells[k]
            rows.append({axis.key: row[axis.key] for axis in self.vary})
        return rows

    def plain(self) -> dict[str, Any]:
        """What distinguishes it from other sweeps, as JSON data."""
        content = {
            "nmm": self.version,
            "scenario": self.scenario,
            "keys": self.keys,
            "robot": self.robot,
            "vary": {axis.key: axis.plain() for axis in self.vary},
        } | {name: getattr(self, name) for name in ("samples", "sampler", "seed", "keep")}
        return json.loads(json.dumps(content, default=str))

    @cached_property
    def digest(self) -> str:
        """Hash of `plain` and the folder of the scenario's files."""
        text = json.dumps([self.plain(), str(self.document.folder)])
        return hashlib.sha256(text.encode()).hexdigest()

    def command(self, index: int) -> list[str]:
        """The command line that runs row `index` alone, in words."""
        (changes,) = self.changes([index])
        words = ["nmm", "run", self.scenario]
        for key, value in {**self.settings, **changes}.items():
            words += ["--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}"]
        return words


def sobol(seed: int, total: int, dimensions: int, first: int, count: int) -> Array:
    """Owen-scrambled Sobol points (count, dimensions) from number `first`; independent of `total`."""
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    if first:  # SciPy cannot go forward by nothing
        engine.fast_forward(first)
    with warnings.catch_warnings():
        # They are balanced in powers of two, asked for or not.
        warnings.filterwarnings("ignore", message=".*balance properties.*")
        return np.asarray(engine.random(count))


def lhs(seed: int, total: int, dimensions: int, first: int, count: int) -> Array:
    """Points of a Latin hypercube of `total`: one in each of `total` strata of every dimension."""
    return _hypercube(seed, total, dimensions)[first : first + count]


@lru_cache(maxsize=1)
def _hypercube(seed: int, total: int, dimensions: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(total))


def random(seed: int, total: int, dimensions: int, first: int, count: int) -> Array:
    """Independent uniform points: the generator's counter is the point's number (Philox)."""
    blocks = -(-dimensions // 4)  # a step of Philox's counter gives four numbers
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)).advance(first * blocks))
    return generator.random((count, 4 * blocks))[:, :dimensions]


def check_total(sampler: str, total: int) -> None:
    """`InputError` for more points than a sampler has."""
    most = {"lhs": MOST_OF_A_HYPERCUBE, "sobol": MOST_OF_SOBOL}.get(sampler, total)
    other = "sobol or random" if sampler == "lhs" else "random"
    expect(total <= most, "samples", f"at most {most} with {sampler} ({other} takes more)", total)


SAMPLERS: dict[str, Callable[[int, int, int, int, int], Array]] = {
    "sobol": sobol,
    "lhs": lhs,
    "random": random,
}


def varied(key: str, value: object) -> Varied:
    """What is given for a dotted key, as text or in Python (see `Sweep`); a range with a count becomes values
    at equal distances, with both bounds. `InputError` for bounds that are no numbers, missing or not in
    order, and for fewer than 2 values."""
    expect(key.strip(), "vary", "a dotted key such as q0.x or resolver.alpha", key)
    if isinstance(value, str):
        return _from_text(key, value)
    if isinstance(value, tuple):
        return _range(key, value, value)
    values = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(values, list):
        expected = "(lower, upper), (lower, upper, count), a list or text"
        raise InputError(where=f"vary {key}", expected=expected, got=value)
    return _listed(key, values)


def parsed(text: str) -> Varied:
    """KEY=LOWER:UPPER[:COUNT] or KEY=VALUE,VALUE,...; `InputError` as `varied`."""
    key, equals, value = text.partition("=")
    expect(equals and key.strip(), "--vary", "KEY=LOWER:UPPER or KEY=VALUE,VALUE,...", text)
    return varied(key.strip(), value.strip())


def _from_text(key: str, text: str) -> Varied:
    values = split_outside_brackets(text, ",")
    if len(values) == 1 and len(bounds := split_outside_brackets(text, ":")) > 1:
        return _range(key, bounds, text)
    if len(values) > 1 and not all(values):
        raise InputError("a value is missing", where=f"vary {key}", expected=EXPECTED, got=text)
    return _listed(key, values)


def _range(key: str, bounds: Sequence[Any], came: object) -> Varied:
    where = f"vary {key}"
    expect(len(bounds) in (2, 3), where, EXPECTED, came)
    for name, bound in zip(("lower bound", "upper bound", "count"), bounds, strict=False):
        if isinstance(bound, str) and not bound:
            raise InputError(f"the {name} is missing", where=where, expected=EXPECTED, got=came)
    try:
        lower, upper, *count = (
            evaluate(bound) if isinstance(bound, str) else number(bound) for bound in bounds
        )
    except InputError as error:
        raise error.at(where) from None
    expect(lower < upper, where, "a lower bound below the upper one", came)
    if not count:
        return Range(key, lower, upper)
    (many,) = count
    whole = many == int(many) and 2 <= many <= MOST_VALUES
    expect(whole, where, f"a count from 2 to {MOST_VALUES}", many)
    steps = int(many) - 1
    inner = (lower + (upper - lower) * (k / steps) for k in range(steps))
    return Listed(key, (*inner, upper))


def _listed(key: str, values: Sequence[Any]) -> Listed:
    plain = [
        float(value) if isinstance(value, Real) and not isinstance(value, int) else value for value in values
    ]
    if len(plain) < 2:
        problem = "one value is no variation: set it" if plain and plain[0] else ""
        raise InputError(problem, where=f"vary {key}", expected=EXPECTED, got=plain[0] if plain else plain)
    differing = {json.dumps(value, default=str) for value in plain}
    expect(len(differing) == len(plain), f"vary {key}", "values that differ", plain)
    return Listed(key, tuple(plain))


def check_varied(scenario: Scenario, vary: tuple[Varied, ...]) -> None:
    """`InputError` for a key that is part of another, `ScenarioError` for one of which no value will do. A
    value valid only beside another one (a threshold with the resolver that has one) will. A start outside
    limits is not looked at here: its row reports it."""
    for axis in vary:
        for other in vary:
            if other.key.startswith(f"{axis.key}."):
                what = f"{other.key} is part of {axis.key}, which varies too"
                raise InputError(what, where="vary", expected="one of them")
    for axis in vary:
        errors = []
        for changed in [_changed(scenario, vary, axis, value) for value in _tried(axis)]:
            try:
                changed.controller()
                break
            except InputError as error:
                errors.append(error)
        else:
            raise errors[0]


def _tried(axis: Varied, shares: tuple[float, ...] = SHARES) -> list[Any]:
    if isinstance(axis, Listed):
        return list(axis.values)
    return [axis.lower + share * (axis.upper - axis.lower) for share in shares]


def _changed(scenario: Scenario, vary: tuple[Varied, ...], axis: Varied, value: Any) -> Scenario:
    """The scenario with one value set: alone, or in the first combination of the others that allows it."""
    try:
        return scenario.with_settings({axis.key: value})
    except InputError as error:
        choices = [[value] if other is axis else _tried(other, SHARES[:1]) for other in vary]
        for chosen in islice(product(*choices), MOST_COMBINATIONS):
            try:
                return scenario.with_settings(dict(zip([each.key for each in vary], chosen, strict=True)))
            except InputError:
                continue
        raise error
