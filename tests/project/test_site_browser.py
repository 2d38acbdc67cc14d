"""The site in a browser: search, light and dark, a phone, accessibility."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from grounds import grounds
from playback_browser import Window
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from playwright.sync_api import Page
from ports import served_folder

PAGES = ["index", "gallery", "singularities", "scenarios", "api/resolver", "api/robot"]


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """The site's, on a server."""
    with served_folder(site) as found:
        yield found


def finds_the_resolvers(page: Page) -> None:
    page.fill(".sidebar-search", "resolver")
    page.press(".sidebar-search", "Enter")
    page.wait_for_selector("#search-results li a[href*='resolvers.html']")  # results come one by one
    found = page.eval_on_selector_all("#search-results li a", "links => links.map(a => a.href)")
    assert any(link.split("#")[0].split("?")[0].endswith("/resolvers.html") for link in found)
    assert any("/api/resolver.html" in link for link in found)


def test_the_search_finds_the_resolvers(address: str, window: Window) -> None:
    finds_the_resolvers(window.open(f"{address}/index.html"))
    window.page.wait_for_load_state("networkidle")


def test_the_search_works_without_a_server(site: Path, empty_page: Page) -> None:
    """Not watched: of files a browser shows no excerpts of what is found, and says so."""
    empty_page.goto((site / "index.html").as_uri())
    finds_the_resolvers(empty_page)
    empty_page.wait_for_load_state("networkidle")
    empty_page.goto("about:blank")


def test_light_and_dark(address: str, window: Window) -> None:
    """As the reader's system has it, and the other way at the press of a button."""
    page = window.page
    page.set_viewport_size({"width": 1280, "height": 900})
    grounds = {}
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        window.open(f"{address}/index.html")
        grounds[scheme] = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert grounds["light"] != grounds["dark"]
    page.click(".theme-toggle-content button")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == grounds["light"]
    page.evaluate("localStorage.clear()")
    page.emulate_media(color_scheme="null")


@pytest.mark.parametrize("chosen", ["light", "dark", "dark by a button"])
@pytest.mark.parametrize(("name", "file"), [("contents", "overview.png"), ("platforms", "car.svg")])
def test_a_figures_ground_is_the_pages(
    address: str, window: Window, name: str, file: str, chosen: str
) -> None:
    """Which in the dark it was not; what is drawn can be seen, and pictures of scenes are as they are."""
    page = window.page
    page.set_viewport_size({"width": 820, "height": 900})
    page.emulate_media(color_scheme="dark" if chosen == "dark" else "light")
    window.open(f"{address}/{name}.html")
    while "button" in chosen and page.evaluate("document.body.dataset.theme") != "dark":
        page.click(".theme-toggle-header button")
    ground, own, most = grounds(page.locator(f"img[src$='/{file}']"))
    assert bool(ground.mean() < 60) == chosen.startswith("dark")
    np.testing.assert_allclose(own, np.broadcast_to(ground, own.shape), atol=3)
    assert most > 100
    assert page.evaluate("""[...document.images].filter(({ src }) => src.endsWith("playback.png"))
      .every((scene) => getComputedStyle(scene).filter === "none")""")
    page.evaluate("localStorage.clear()")
    page.emulate_media(color_scheme="null")


@pytest.mark.parametrize("name", PAGES)
def test_a_page_fits_a_phone(address: str, window: Window, name: str) -> None:
    window.page.set_viewport_size({"width": 420, "height": 900})
    page = window.open(f"{address}/{name}.html")
    assert page.evaluate("document.documentElement.scrollWidth") == 420


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", PAGES)
def test_a_page_has_no_serious_fault(address: str, window: Window, name: str, scheme: str) -> None:
    file = os.environ.get("NMM_AXE", "")
    if not file:
        pytest.skip("axe-core is not here: npm install axe-core, and NMM_AXE=…/axe-core/axe.min.js")
    page = window.page
    page.emulate_media(color_scheme=scheme)
    window.open(f"{address}/{name}.html")
    page.evaluate(Path(file).read_text(encoding="utf-8"))
    faults = page.evaluate(
        "axe.run().then(({ violations }) => violations.map(({ impact, id }) => [impact, id]))"
    )
    page.emulate_media(color_scheme="null")
    assert [fault for fault in faults if fault[0] in ("serious", "critical")] == []
