"""Every registered resolver, for the tests that go through all of them."""

from __future__ import annotations

import inspect

from nmm.base.kinds import RESOLVERS
from nmm.control.resolvers import Resolver


def every_resolver(**wanted: object) -> dict[str, Resolver]:
    """One of each kind by name, with those of the wanted keywords that its constructor takes."""
    made: dict[str, Resolver] = {}
    for name, kind in RESOLVERS.items():
        taken = inspect.signature(kind).parameters
        needed = [key for key, p in taken.items() if p.default is p.empty and key not in wanted]
        assert not needed, f"{name}: tests/helpers/resolver_grid.py must say what {needed} is"
        made[name] = kind(**{key: value for key, value in wanted.items() if key in taken})
    return made
