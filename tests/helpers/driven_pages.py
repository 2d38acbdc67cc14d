"""Pages of robots that are driven."""

from __future__ import annotations

from contextlib import AbstractContextManager

from playback_browser import Window
from playwright.sync_api import Page
from ports import served

from nmm.plugins.live.driving import DriveSetup, drive


def driven(setup: DriveSetup) -> AbstractContextManager[str]:
    """The address of a robot that is driven."""
    return served(drive, setup)


def opened(window: Window, url: str) -> Page:
    page = window.open(url)
    page.wait_for_function("nmm.drive.targets.length > 0 && nmm.drive.time > 0 && nmm.gizmos.all.length > 0")
    return page
