"""The loop of a robot that is driven, and what a page would be told of it."""

from __future__ import annotations

import json

import nmm
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.session import DriveSession
from nmm.plugins.live.driving.setups import DriveSetup, ScenarioSetup


def scenario(name: str = "unicycle_3r_position") -> ScenarioSetup:
    return ScenarioSetup(nmm.Scenario.load(name))


class Loop:
    """A session, and what a page would be told."""

    def __init__(self, setup: DriveSetup) -> None:
        self.session = DriveSession(Driven(setup))
        self.latest = self.session.follow()

    def __enter__(self) -> Loop:
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()
        assert self.session._thread is not None
        assert not self.session._thread.is_alive()

    def picture(self) -> dict[str, object]:
        return json.loads(self.latest().splitlines()[-1])
