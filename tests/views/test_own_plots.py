"""Plots that a user puts together, and axes that he zooms, in a real browser."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from figure_examples import run
from playback_browser import Window, watched
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playwright.sync_api import Locator, Page

from nmm.motion.trajectory import Trajectory
from nmm.views.playback import write_html


@pytest.fixture(scope="module")
def runs() -> list[Trajectory]:
    return [run("unicycle_2r_position", kind, duration=6.0) for kind in ("rg", "pg")]


@pytest.fixture(scope="module")
def opened(
    empty_page: Page, runs: list[Trajectory], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Window, str]]:
    url = write_html(runs, tmp_path_factory.mktemp("own") / "page.html", title="Two").as_uri()
    with watched(empty_page) as window:
        window.page.set_viewport_size({"width": 1000, "height": 900})
        yield window, url


@pytest.fixture
def page(opened: tuple[Window, str]) -> Page:
    window, url = opened
    return window.open(url)


#: The last plot's.
LANE = "nmm.plots.panels.at(-1).lanes[0]"


def own(page: Page, number: int = 0) -> Locator:
    return page.locator("[data-panel^=own]").nth(number)


def told(panel: Locator) -> list[float]:
    texts = panel.locator("summary .now > span:not([hidden])").all_inner_texts()
    return [float(text.replace("−", "-")) for text in texts]


def values(runs: list[Trajectory], t: float) -> dict[str, list[float]]:
    """The coordinates and inputs of each run between two samples."""
    names = [*runs[0].robot.q_names, *(f"u_{name}" for name in runs[0].robot.u_names)]
    columns = [np.hstack([one.q, one.u]) for one in runs]
    return {
        name: [float(np.interp(t, one.t, x[:, i])) for one, x in zip(runs, columns, strict=True)]
        for i, name in enumerate(names)
    }


def on_canvas(panel: Locator) -> tuple[float, float]:
    canvas = panel.locator("canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    assert box is not None
    return box["x"], box["y"]


def test_quantities_of_ones_choice_share_a_plot(page: Page, runs: list[Trajectory]) -> None:
    page.get_by_role("button", name="Add a plot").click()
    panel = own(page)
    more = panel.get_by_label("Another quantity")
    for key in ("q1", "u_omega"):
        more.select_option(key)
    assert panel.locator("summary").inner_text().startswith("q₁ [rad], ω [rad/s]")
    page.evaluate("nmm.seek(2.345)")
    wanted = values(runs, 2.345)
    assert told(panel) == pytest.approx([*wanted["q1"], *wanted["u_omega"]], rel=1e-3)
    # A press seeks, as in the other plots.
    left, top = on_canvas(panel)
    page.mouse.click(left + page.evaluate(f"{LANE}.plot.x(4)"), top + 40)
    assert page.evaluate("nmm.state().t") == pytest.approx(4.0, abs=0.02)
    # Out again: a quantity, a run, the plot.
    panel.get_by_role("button", name="q₁ ×").click()
    assert told(panel) == pytest.approx(values(runs, page.evaluate("nmm.state().t"))["u_omega"], rel=1e-3)
    page.locator("#legend button", has_text="PG").click()
    assert len(told(panel)) == 1
    panel.get_by_role("button", name="Take this plot away").click()
    assert page.locator("[data-panel^=own]").count() == 0


def test_a_quantity_over_another_has_the_clock_on_its_curve(page: Page, runs: list[Trajectory]) -> None:
    page.get_by_role("button", name="Add a plot").click()
    panel = own(page)
    panel.get_by_label("Another quantity").select_option("y")
    panel.get_by_label("Over", exact=True).select_option("x")
    assert panel.locator("summary").inner_text().startswith("y [m] over x [m]")
    left, top = on_canvas(panel)
    place = f"([x, y]) => [{LANE}.plot.x(x), {LANE}.plot.y(y)]"
    for t in (0.0, 1.7, 5.2):
        page.evaluate(f"nmm.seek({t})")
        wanted = values(runs, t)
        for i, dot in enumerate(panel.locator(".dot").all()):
            box = dot.bounding_box()
            assert box is not None
            px, py = page.evaluate(place, [wanted["x"][i], wanted["y"][i]])
            assert (box["x"] + 4 - left, box["y"] + 4 - top) == pytest.approx((px, py), abs=0.6)
    # A metre is as long in both directions.
    [x0, y0], [x1, y1] = page.evaluate(place, [0, 0]), page.evaluate(place, [1, 1])
    assert x1 - x0 == pytest.approx(y0 - y1, rel=1e-6)
    # A press on the curve goes to when it was there.
    wanted = values(runs, 1.2)
    px, py = page.evaluate(place, [wanted["x"][0], wanted["y"][0]])
    page.mouse.click(left + px, top + py)
    now = values(runs, page.evaluate("nmm.state().t"))
    near = min(np.hypot(now["x"][i] - wanted["x"][0], now["y"][i] - wanted["y"][0]) for i in range(len(runs)))
    assert near <= 2.0 / (x1 - x0)  # two pixels


def test_the_address_has_the_plots(page: Page) -> None:
    for keys, over in (("'q1', 'u_v'", ""), ("'y'", "x"), ("'error_norm'", "")):
        page.evaluate(f"nmm.own.add([{keys}], '{over}')")
    page.wait_for_function("location.hash.endsWith('&plot=q1,u_v&plot=y~x&plot=error_norm')")
    for number in (2, 1):
        own(page, number).get_by_label("log").check()
    page.wait_for_function("location.hash.endsWith('&plot=q1,u_v&plot=y~x~log&plot=error_norm~~log')")
    own(page, 1).get_by_label("log").uncheck()
    page.wait_for_function("location.hash.endsWith('&plot=q1,u_v&plot=y~x&plot=error_norm~~log')")
    address = page.url
    page.goto("about:blank")
    page.goto(address)
    page.wait_for_function("!document.body.classList.contains('loading')")
    titles = [own(page, i).locator("summary > span").first.inner_text() for i in range(2)]
    assert titles == ["q₁ [rad], v [m/s]", "y [m] over x [m]"]
    assert [own(page, i).get_by_label("log").is_checked() for i in range(3)] == [False, False, True]
    assert page.evaluate(
        "nmm.plots.panels.filter((panel) => panel.own).map(({ lanes }) => lanes[0].log)"
    ) == [*(False, False, True)]
    page.evaluate("location.hash = '#plot=nobody&plot=u_v~constructor&plot=__proto__'")
    page.wait_for_function("nmm.own.text().join() === 'plot=u_v'")


#: Of a wheel, 3,000 times at a place.
TURN = """([clientX, clientY, deltaY]) => {
  const canvas = document.querySelector("[data-panel=inputs] canvas");
  const turn = () => new WheelEvent("wheel", { clientX, clientY, deltaY, cancelable: true });
  for (let k = 0; k < 3000; k++) canvas.dispatchEvent(turn());
}"""
AXIS = "nmm.lanes.find(({ key }) => key === 'u_v').scale"


def test_a_wheel_over_its_numbers_zooms_an_axis(page: Page) -> None:
    page.evaluate("nmm.plots.open(['inputs'])")
    canvas = page.locator("[data-panel=inputs] canvas")
    box = canvas.bounding_box()
    assert box is not None
    whole = page.evaluate(AXIS)
    plot = page.evaluate("nmm.lanes.find(({ key }) => key === 'u_v').plot")
    y = box["y"] + plot["top"] + 0.25 * plot["height"]
    at = whole["high"] - 0.25 * (whole["high"] - whole["low"])
    page.mouse.move(box["x"] + 20, y)
    page.mouse.wheel(0, -100)
    page.wait_for_function(f"{AXIS}.high < {whole['high']!r}")
    nearer = page.evaluate(AXIS)
    assert nearer["high"] - nearer["low"] == pytest.approx(0.8 * (whole["high"] - whole["low"]))
    assert nearer["high"] - 0.25 * (nearer["high"] - nearer["low"]) == pytest.approx(at, abs=0.02)
    assert page.evaluate("nmm.state().t") == 0.0
    # A drag moves it by as much as the pointer moves.
    page.mouse.down()
    page.mouse.move(box["x"] + 20, y + 10, steps=2)
    page.mouse.up()
    moved = page.evaluate(AXIS)
    by = 10 / plot["height"] * (nearer["high"] - nearer["low"])
    assert moved["high"] - nearer["high"] == pytest.approx(by, rel=1e-6)
    assert page.evaluate("nmm.state().t") == 0.0
    assert page.locator("#whole").is_enabled()
    page.mouse.dblclick(box["x"] + 20, y)
    assert page.evaluate(AXIS) == whole
    assert page.locator("#whole").is_disabled()
    # However long one turns the wheel, in or out, the axis has numbers.
    for turned in (-100, 100):
        page.evaluate(TURN, [box["x"] + 20, y, turned])
        ends = page.evaluate(AXIS)
        assert 0.0 < ends["high"] - ends["low"] < 1e251
        page.mouse.dblclick(box["x"] + 20, y)
        assert page.evaluate(AXIS) == whole
    # All axes at once, as they were.
    page.mouse.wheel(0, -100)
    page.wait_for_function(f"{AXIS}.high < {whole['high']!r}")
    page.locator("#whole").click()
    assert page.evaluate(AXIS) == whole


@pytest.mark.parametrize(
    ("low", "high"), [(0.99, 1.01), (0.21, 0.36), (2.2, 4.1), (0.9, 3.0), (3e-7, 2e-2), (1e-9, 1e3)]
)
@pytest.mark.parametrize("height", [46, 84, 150])
def test_numbers_of_a_logarithmic_axis_tell_it_and_do_not_collide(
    page: Page, low: float, high: float, height: int
) -> None:
    ends = f"{{ log: true, low: {math.log10(low)}, high: {math.log10(high)} }}"
    ticks: list[dict[str, Any]] = page.evaluate(f"nmm.axes.ticks({ends}, {height})")
    assert len(ticks) >= 3
    places = np.sort([height * np.log10(10.0 ** tick["at"] / low) / np.log10(high / low) for tick in ticks])
    assert np.diff(places).min() >= 11.0 - 1e-9
    powers = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    for tick in ticks:
        parts = re.fullmatch(r"(?:([25])·)?10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", tick["text"])
        number = (
            float(parts[1] or 1) * 10.0 ** int(parts[2].translate(powers)) if parts else float(tick["text"])
        )
        assert number == pytest.approx(10.0 ** tick["at"], rel=1e-9)


def test_what_is_never_below_zero_has_no_axis_there(page: Page) -> None:
    """σ_min of a singular posture was drawn between -0.8 and 0.8."""
    over = "nmm.axes.over([{ column: { values: [VALUES], limits: [0, null] }, first: 0, last: 2 }], false)"
    for numbers in ("0, 0, 0", "0, 0.3, 0.2"):
        axis = page.evaluate(over.replace("VALUES", numbers))
        assert -0.05 * axis["high"] <= axis["low"] <= 0.0
    assert page.evaluate(over.replace("VALUES", "0, 0, 0").replace("0, null", "null, null"))["low"] < -0.5


def test_ends_that_no_number_tells_are_not_zoomed_to(page: Page) -> None:
    """Where the ends are one number, or none, to look for numbers between them would never end."""
    for low, high, log in ((-400, -399, True), (300, 301, True), (-3, -3 + 1e-9, True), (1.0, 1.0, False)):
        assert not page.evaluate(f"nmm.axes.told({low}, {high}, {str(log).lower()})")
    for low, high, log in (
        (-299, 299, True),
        (-3.0, -2.99999, True),
        (-1e-79, 1e-79, False),
        (-9e249, 9e249, False),
    ):
        assert page.evaluate(f"nmm.axes.told({low}, {high}, {str(log).lower()})")
        assert page.evaluate(f"nmm.axes.ticks({{ low: {low}, high: {high}, log: {str(log).lower()} }}, 84)")
