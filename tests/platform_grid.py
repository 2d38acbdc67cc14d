"""Every kind of platform with some of its parameters, for the tests that go through all of them.

A new platform is tested by a new entry in `EXAMPLES`; `test_platforms.py` notices when one is missing.
"""

from __future__ import annotations

from nmm.platforms import Platform, Unicycle

#: Examples by a name for the test's id.
EXAMPLES: dict[str, Platform] = {
    "unicycle": Unicycle(),
}
