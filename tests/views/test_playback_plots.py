"""The plots beside the scene, in a real browser: one clock, what is shown, the address, keys, any window."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from figure_examples import cut, run
from playback_browser import Window, draw_frames, watched
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from playback_robot import drive, hand_built_robot
from playwright.sync_api import Browser, Page

from nmm.base.resolver_style import resolver_styles
from nmm.motion.trajectory import Trajectory
from nmm.views.playback import write_html

NAMES = ("RG", "PG", "EJ")
#: As it was opened.
AGAIN = """() => {
  nmm.player.pause();
  nmm.runs.forEach((run) => nmm.hide(run, false));
  nmm.plots.open(nmm.plots.first);
  nmm.plots.show(true);
  nmm.plots.whole();
  nmm.player.setSpeed(1);
  if (nmm.camera.following) nmm.actions.follow();
  nmm.camera.look("iso");
  nmm.player.seek(0);
  document.activeElement.blur();
}"""
ROOTS = """() => nmm.motions.map(({ path }) => {
  const [x, y, turned] = ["x", "x/y", "x/y/theta"].map((joint) => nmm.node(`${path}/robot/${joint}`));
  return [x.position.x, y.position.y, 2 * Math.atan2(turned.quaternion.z, turned.quaternion.w)];
})"""
#: A time is shown, and what the page then says of it: its state, where the robots are, where the cursor is.
SOUGHT = f"""(t) => {{
  nmm.seek(t);
  return [nmm.state(), ({ROOTS})(), document.getElementById("cursor").getBoundingClientRect().x];
}}"""
#: Everything of the page that one can see and that leaves the window or its own box.
CUT = """() => [...document.querySelectorAll("button, select, input, output, h1, h2, li, summary, canvas")]
  .filter((one) => one.checkVisibility() && !one.closest(".dg"))
  .filter((one) => {
    const box = one.getBoundingClientRect();
    const scrolls = one.closest("#plots") !== null;
    return box.left < -0.5 || box.right > innerWidth + 0.5
      || (one.scrollWidth > one.clientWidth + 1 && one.clientWidth > 0)
      || (!scrolls && (box.top < -0.5 || box.bottom > innerHeight + 0.5));
  })
  .map((one) => one.outerHTML.slice(0, 80))"""


@dataclass
class Plotted:
    """One page of three runs for many checks, and what the runs' folders hold, and torques."""

    page: Page
    url: str
    arrays: list[dict[str, Any]]

    def wanted(self, t: float) -> list[dict[str, float]]:
        """The channels' values between two samples, from the arrays."""
        found = []
        for file in self.arrays:
            columns = {"error_norm": np.linalg.norm(file["error"], axis=1)}
            columns |= {name: file[name] for name in ("objective", "sigma_min", "residual", "margin")}
            for names, prefix, values in (
                ("q_names", "", "q"),
                ("u_names", "u_", "u"),
                ("r_names", "error_", "error"),
                ("torque_names", "torque ", "torque"),
            ):
                columns |= {f"{prefix}{name}": file[values][:, i] for i, name in enumerate(file[names])}
            found.append({name: float(np.interp(t, file["t"], column)) for name, column in columns.items()})
        return found

    def state(self) -> dict[str, Any]:
        return self.page.evaluate("nmm.state()")  # type: ignore[no-any-return]

    def place(self, panel: str, t: float, lane: int = 0) -> tuple[float, float]:
        """Where a panel shows a time, in the window."""
        canvas = self.page.locator(f"[data-panel={panel}] canvas")
        canvas.scroll_into_view_if_needed()
        box = canvas.bounding_box()
        assert box is not None
        low, high, left, right = self.page.evaluate(
            "[nmm.player.range.from, nmm.player.range.to, nmm.curves.LEFT, nmm.curves.RIGHT]"
        )
        share = (t - low) / (high - low)
        return box["x"] + left + share * (box["width"] - right - left), box["y"] + 67 * lane + 35


@pytest.fixture(scope="module")
def runs() -> list[Trajectory]:
    """With 50 samples a second none is thinned."""
    return [run("unicycle_2r_position", kind, duration=6.0) for kind in ("rg", "pg", "ej")]


@pytest.fixture(scope="module")
def opened(
    empty_page: Page, runs: list[Trajectory], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Plotted]:
    folder = tmp_path_factory.mktemp("plots")
    arrays = []
    for one in runs:
        one.save(folder / one.resolver, figures=False)
        with np.load(folder / one.resolver / "trajectory.npz", allow_pickle=False) as file:
            arrays.append({name: file[name] for name in file.files})
        found = one.torques()
        arrays[-1] |= {"torque_names": found.names, "torque": found.torques}
    url = write_html(runs, folder / "page.html", title="Three").as_uri()
    with watched(empty_page) as window:
        window.page.set_viewport_size({"width": 1000, "height": 640})
        yield Plotted(window.open(url), url, arrays)


@pytest.fixture
def plotted(opened: Plotted) -> Plotted:
    opened.page.evaluate(AGAIN)
    return opened


def test_cursor_table_and_scene_agree_with_the_runs_arrays(
    plotted: Plotted, rng: np.random.Generator
) -> None:
    page = plotted.page
    left, right = (plotted.place("H", t)[0] for t in (0.0, 6.0))
    for t in rng.uniform(0.0, 6.0, 12).tolist():
        state, roots, cursor = page.evaluate(SOUGHT, t)
        wanted = plotted.wanted(t)
        assert state["t"] == pytest.approx(t, abs=1e-12)
        assert [one["name"] for one in state["runs"]] == list(NAMES)
        for one, expected in zip(state["runs"], wanted, strict=True):
            assert set(one["values"]) - {"partition"} <= set(expected)
            for name, value in one["values"].items():
                if name != "partition":
                    assert value == pytest.approx(expected[name], rel=1e-6, abs=1e-6), name
        for root, expected in zip(roots, wanted, strict=True):
            np.testing.assert_allclose(root[:2], [expected["x"], expected["y"]], atol=1e-6)
            assert np.exp(1j * root[2]) == pytest.approx(np.exp(1j * expected["theta"]), abs=1e-6)
        assert cursor + 0.75 == pytest.approx(np.interp(t, [0.0, 6.0], [left, right]), abs=0.05)
    # The table is kept up where it is seen.
    page.locator("#values").scroll_into_view_if_needed()
    for t in rng.uniform(0.0, 6.0, 2).tolist():
        page.evaluate(f"nmm.seek({t!r})")
        draw_frames(page)
        wanted = plotted.wanted(t)
        for name in ("error_norm", "q1", "u_v"):
            cells = page.locator(f"tr[data-channel={name}] td").all_inner_texts()
            assert [float(text.replace("−", "-")) for text in cells[:3]] == pytest.approx(
                [expected[name] for expected in wanted], rel=1e-5, abs=1e-9
            )


def test_a_seek_draws_no_curve_again(plotted: Plotted) -> None:
    strokes = """() => {
      let count = 0;
      const { stroke } = CanvasRenderingContext2D.prototype;
      CanvasRenderingContext2D.prototype.stroke = function (...all) {
        count += 1;
        return stroke.apply(this, all);
      };
      for (let k = 0; k < 20; k++) nmm.seek(0.3 * k);
      const seeking = count;
      nmm.plots.redraw();
      CanvasRenderingContext2D.prototype.stroke = stroke;
      return [seeking, count];
    }"""
    seeking, redrawn = plotted.page.evaluate(strokes)
    assert seeking == 0
    assert redrawn >= 3 * 3


def test_press_and_drag_in_a_plot_move_the_robots(plotted: Plotted) -> None:
    page = plotted.page
    for panel, t in (("error", 2.4), ("inputs", 4.7)):
        page.mouse.click(*plotted.place(panel, t))
        now = plotted.state()["t"]
        assert now == pytest.approx(t, abs=0.02)
        assert page.evaluate(ROOTS)[1][0] == pytest.approx(plotted.wanted(now)[1]["x"], abs=1e-6)
    page.mouse.move(*plotted.place("H", 1.0))
    page.mouse.down()
    page.mouse.move(*plotted.place("H", 3.0))
    assert plotted.state()["t"] == pytest.approx(3.0, abs=0.02)
    page.mouse.move(3000, 100)
    assert plotted.state()["t"] == pytest.approx(6.0, abs=1e-9)
    page.mouse.up()


def in_headers(plotted: Plotted, key: str) -> list[float]:
    """What the header of a channel says of each run."""
    texts = plotted.page.evaluate(
        f"nmm.lanes.find((lane) => lane.key === '{key}').values.map((part) => part.textContent)"
    )
    return [float(text.replace("−", "-")) for text in texts]


def test_headers_tell_every_runs_value_at_the_pointer_or_at_the_cursor(plotted: Plotted) -> None:
    page = plotted.page
    page.mouse.move(*plotted.place("inputs", 2.0, lane=1))
    hair = page.locator("#hair")
    assert hair.is_visible()
    at = float(hair.inner_text().split()[0])
    assert at == pytest.approx(2.0, abs=0.02)
    for key in ("u_omega", "error_norm"):  # of all panels, not of the one pointed at alone
        wanted = [expected[key] for expected in plotted.wanted(at)]
        assert in_headers(plotted, key) == pytest.approx(wanted, rel=6e-3, abs=1e-9)
    assert plotted.state()["t"] == 0.0
    assert not page.locator("#tip").is_visible()
    page.mouse.move(5, 5)
    assert not hair.is_visible()
    for t in (0.0, 3.3):
        page.evaluate(f"nmm.seek({t})")
        wanted = [expected["u_omega"] for expected in plotted.wanted(t)]
        assert in_headers(plotted, "u_omega") == pytest.approx(wanted, rel=5e-4, abs=1e-9)


def test_a_clock_outside_the_zoom_is_said(plotted: Plotted) -> None:
    page = plotted.page
    cursor = page.locator("#cursor span")
    for t, sign in ((5.5, "▶"), (1.25, "◀")):
        page.evaluate(f"nmm.seek({t}); nmm.plots.zoom(2, 4)")
        assert set(cursor.inner_text().split()) == {f"{t}", "s", sign}
        wanted = [expected["u_omega"] for expected in plotted.wanted(t)]
        assert in_headers(plotted, "u_omega") == pytest.approx(wanted, rel=5e-4, abs=1e-9)
        assert page.evaluate("document.body.classList.contains('beyond')")
    page.evaluate("nmm.player.play(); nmm.player.pause()")
    assert plotted.state()["t"] == 2.0
    assert cursor.inner_text() == ""
    assert not page.evaluate("document.body.classList.contains('beyond')")
    page.evaluate("nmm.plots.whole()")


def test_the_legend_hides_a_run_everywhere(plotted: Plotted) -> None:
    page = plotted.page
    inked = """(color) => {
      const canvas = document.querySelector("[data-panel=H] canvas");
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      const wanted = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
      let count = 0;
      for (let k = 0; k < data.length; k += 4) count += wanted.every((c, i) => Math.abs(data[k + i] - c) < 6);
      return count;
    }"""
    vermillion = resolver_styles()["pg"][0]
    assert page.evaluate(inked, vermillion) > 20
    for hidden in (True, False):
        page.locator("#legend button", has_text="PG").click()
        state = plotted.state()
        assert [one["hidden"] for one in state["runs"]] == [False, hidden, False]
        assert page.evaluate("nmm.motions.map(({ path }) => nmm.node(path).visible)") == [
            True,
            not hidden,
            True,
        ]
        assert (page.evaluate(inked, vermillion) == 0) is hidden
        assert page.locator("#values thead th", has_text="PG").is_visible() is not hidden
        assert page.locator("tr[data-channel=q1] td").nth(1).is_visible() is not hidden
        page.wait_for_function(f"location.hash.includes('hide=pg') === {str(hidden).lower()}")


def test_zoom_takes_the_bar_along(plotted: Plotted) -> None:
    page = plotted.page
    ruler = page.locator("#ruler").bounding_box()
    assert ruler is not None
    y = ruler["y"] + 9
    page.mouse.move(plotted.place("error", 2.0)[0], y)
    page.mouse.down()
    page.mouse.move(plotted.place("error", 4.0)[0], y)
    page.mouse.up()
    low, high = page.evaluate("[nmm.player.range.from, nmm.player.range.to]")
    assert (low, high) == pytest.approx((2.0, 4.0), abs=0.03)
    assert float(page.locator("#slider").get_attribute("min") or 0) == low
    assert float(page.locator("#slider").get_attribute("max") or 0) == high
    # Elsewhere it comes along; Home and End are its ends, and a press is at the time that is drawn there.
    page.evaluate("nmm.seek(5)")
    assert page.evaluate("nmm.player.range.to") == pytest.approx(5.0)
    page.keyboard.press("Home")
    assert plotted.state()["t"] == pytest.approx(5.0 - (high - low))
    page.mouse.click(*plotted.place("H", 4.0))
    assert plotted.state()["t"] == pytest.approx(4.0, abs=0.01)
    page.locator("#whole").click()
    assert page.evaluate("nmm.player.range") == {"from": 0, "to": 6}
    assert page.locator("#whole").is_disabled()
    page.keyboard.press("+")
    assert page.evaluate("nmm.player.range.to - nmm.player.range.from") == pytest.approx(3.0)
    page.keyboard.press("-")
    page.keyboard.press("+")
    page.keyboard.press("0")
    assert page.evaluate("nmm.player.range") == {"from": 0, "to": 6}


#: What is written while all is drawn again: each text with its middle, px, and its canvas.
WRITTEN = """() => {
  const found = [];
  const pen = CanvasRenderingContext2D.prototype;
  const write = pen.fillText;
  pen.fillText = function (text, x, y) {
    const wide = this.measureText(text).width;
    const left = { left: x, start: x, center: x - 0.5 * wide, right: x - wide }[this.textAlign];
    found.push([this.canvas.id || this.canvas.parentElement.dataset.panel, text, left, left + wide, y]);
    write.call(this, text, x, y);
  };
  nmm.plots.redraw();
  pen.fillText = write;
  return found;
}"""


def test_a_long_name_ends_before_the_values_and_keeps_its_unit(plotted: Plotted) -> None:
    """And the cursor is behind it."""
    page = plotted.page
    page.evaluate("nmm.plots.open(['inputs']); nmm.seek(0)")
    row = page.locator("[data-panel=inputs] .row").nth(1)
    short = row.locator(".name").inner_text()
    row.locator(".name").evaluate("name => name.textContent = 'rate of shoulder_lift_joint_of_the_left_arm'")
    parts = row.evaluate("row => [...row.children].map((part) => part.getBoundingClientRect().toJSON())")
    named = row.locator(".name").evaluate("({ scrollWidth, clientWidth }) => scrollWidth > clientWidth")
    row.locator(".name").evaluate("(name, short) => (name.textContent = short)", short)
    cursor = page.locator("#cursor").bounding_box()
    behind = page.evaluate("getComputedStyle(document.getElementById('cursor')).zIndex")
    page.evaluate("nmm.plots.open(nmm.plots.first)")
    assert named
    shown = [part for part in parts if part["width"]]
    assert len(shown) == 3
    for before, after in pairwise(shown):
        assert before["right"] <= after["left"] + 0.5
    assert shown[0]["width"] > 80.0
    assert cursor is not None
    assert shown[0]["left"] < cursor["x"] < shown[0]["right"]
    assert int(behind) < row.evaluate("row => Number(getComputedStyle(row).zIndex)")


#: A quantity that two decimals or a power of ten tell.
NUMBER = re.compile(r"−?[\d.]+(e−?\d+)?")


def test_every_axis_has_numbers_that_tell_two_values(plotted: Plotted) -> None:
    """Also where limits stretch it, a curve does not move, or moves about a large value."""
    page = plotted.page
    page.evaluate("nmm.plots.open(nmm.plots.panels.map(({ id }) => id))")
    lanes = page.evaluate("nmm.lanes.filter(({ panel }) => panel === 'inputs').length")
    for name, values in {
        "limits": "(i, n) => 0.3 * Math.sin(i / 20)",
        "still": "() => 0.1",
        "nothing": "() => 0",
        "rounding": "(i) => (i % 2) * 3e-16",
        "high": "(i) => 5000 + 0.02 * i",
        "small": "(i) => 3e-7 * Math.cos(i / 9)",
    }.items():
        page.evaluate(
            f"""() => nmm.runs.forEach((run) => nmm.lanes.forEach((lane) => {{
              if (lane.panel !== "inputs") return;
              const column = run.columns[lane.key];
              column.values = Float32Array.from(run.t, {values});
              column.limits = "{name}" === "limits" ? [-0.68, 0.68] : [null, null];
            }}))"""
        )
        written = [one for one in page.evaluate(WRITTEN) if one[0] == "inputs"]
        ticks = [one for one in written if NUMBER.fullmatch(one[1]) and one[3] < 56]
        assert len({text for _, text, *_ in ticks}) >= 2, name
        assert len(ticks) >= 2 * lanes
        by_lane: dict[int, list[str]] = {}
        for _, text, left, _, y in ticks:
            assert left >= -1.0, (name, text)  # not cut off
            by_lane.setdefault(int(y // 67), []).append(text)
        for texts in by_lane.values():
            assert 2 <= len(texts) <= 3
            assert len(set(texts)) == len(texts), name


@pytest.mark.parametrize(("first", "last"), [(0.0, 6.0), (1.37, 4.93), (2.3411, 2.3622), (5.02, 6.0)])
def test_both_ends_of_the_time_axis_are_told(plotted: Plotted, first: float, last: float) -> None:
    page = plotted.page
    page.evaluate(f"nmm.plots.zoom({first}, {last})")
    written = sorted([*one[2:4], one[1]] for one in page.evaluate(WRITTEN) if one[0] == "ruler")
    assert written[0][2] == "t [s]"
    times = [float(text) for _, _, text in written[1:]]
    assert len(times) >= 3
    assert times == sorted(set(times))
    for told, wanted in ((times[0], first), (times[-1], last)):
        assert told == pytest.approx(wanted, abs=0.003 * (last - first))
    width = page.evaluate("document.getElementById('stack').clientWidth")
    assert written[-1][1] <= width
    for one, following in pairwise(written):
        assert one[1] < following[0]
    # Each stands where its time is, but at the ends, where it is moved into the picture.
    low, high = page.evaluate(
        "[nmm.curves.LEFT, document.getElementById('stack').clientWidth - nmm.curves.RIGHT]"
    )
    for left, right, text in written[2:-1]:
        share = (float(text) - first) / (last - first)
        assert 0.5 * (left + right) == pytest.approx(low + share * (high - low), abs=1.0)


def test_the_address_is_the_state(plotted: Plotted) -> None:
    page = plotted.page
    page.evaluate("nmm.seek(2.5)")
    page.keyboard.press("v")
    page.locator("#legend button", has_text="RG").click()
    page.evaluate("nmm.plots.open(['H', 'error'])")
    page.evaluate("nmm.plots.zoom(1, 3)")
    page.wait_for_function("location.hash === '#t=2.5&view=top&hide=rg&plots=error,H&zoom=1,3'")
    address = page.url
    page.goto("about:blank")
    page.goto(address)
    page.wait_for_function("!document.body.classList.contains('loading')")
    assert plotted.state()["t"] == 2.5
    assert [one["hidden"] for one in plotted.state()["runs"]] == [True, False, False]
    assert page.evaluate("[nmm.camera.from, nmm.plots.opened(), nmm.player.range.to]") == [
        "top",
        ["error", "H"],
        3,
    ]
    assert page.locator("#legend button").first.get_attribute("aria-pressed") == "false"
    # Another address in an open page, and one that says nothing that is known.
    page.evaluate("location.hash = '#t=4&hide=&view=front&plots=sigma&zoom=0,6'")
    page.wait_for_function("nmm.state().t === 4")
    assert page.evaluate("[nmm.camera.from, nmm.plots.opened()]") == ["front", ["sigma"]]
    page.evaluate("location.hash = '#t=soon&hide=nobody&view=constructor&plots=__proto__&zoom=9,1,x&what'")
    draw_frames(page)
    assert page.evaluate("[nmm.state().t, nmm.camera.from, nmm.plots.opened()]") == [4, "front", ["sigma"]]
    page.evaluate("location.hash = '#plots=none'")
    page.wait_for_function("!document.body.classList.contains('plots')")
    # The camera, once somebody has put it somewhere: until he asks for the whole scene again.
    assert "camera" not in page.url
    page.mouse.move(400, 300)
    page.mouse.down()
    page.mouse.move(340, 330, steps=3)
    page.mouse.up()
    page.wait_for_function("location.hash.includes('camera=') && location.hash === nmm.address.text()")
    address, placed = page.url, page.evaluate("nmm.camera.place()")
    page.goto("about:blank")
    page.goto(address)
    page.wait_for_function("!document.body.classList.contains('loading')")
    np.testing.assert_allclose(page.evaluate("nmm.camera.place()"), placed, rtol=1e-5, atol=1e-5)
    page.keyboard.press("r")
    page.wait_for_function("!location.hash.includes('camera=')")


def test_every_key_acts_and_none_is_stolen(plotted: Plotted) -> None:
    page = plotted.page
    pressed = {"p": "paths", "g": "ghosts", "f": "follow", "l": "loop", "c": "curves", "d": "distances"}
    for key, button in pressed.items():
        before = page.locator(f"#{button}").get_attribute("aria-pressed")
        page.keyboard.press(key)
        assert page.locator(f"#{button}").get_attribute("aria-pressed") != before
        page.keyboard.press(key)
        assert page.locator(f"#{button}").get_attribute("aria-pressed") == before
    for key, t in (
        ("End", 6.0),
        ("ArrowLeft", 5.5),
        ("Shift+ArrowLeft", 5.5 - 1 / 60),
        ("Home", 0.0),
        ("ArrowRight", 0.5),
    ):
        page.keyboard.press(key)
        assert plotted.state()["t"] == pytest.approx(t, abs=1e-9)
    page.keyboard.press("ArrowUp")
    assert page.locator("#speed").input_value() == "2"
    page.keyboard.press("ArrowDown")
    page.evaluate("nmm.camera.moved = true")
    page.keyboard.press("r")
    assert page.evaluate("nmm.camera.moved") is False
    for side in ("top", "front", "wall", "iso"):
        page.keyboard.press("v")
        assert page.locator("#from").input_value() == side
    # A button, a list and a fold that have the focus keep their own keys.
    page.locator("#ghosts").focus()
    page.keyboard.press("Space")
    assert page.locator("#ghosts").get_attribute("aria-pressed") == "false"
    page.keyboard.press("Enter")
    assert page.locator("#ghosts").get_attribute("aria-pressed") == "true"
    page.locator("#speed").focus()
    page.keyboard.press("ArrowDown")
    assert page.locator("#speed").input_value() == "2"
    page.locator("[data-panel=coordinates] summary").focus()
    page.keyboard.press("Space")
    assert "coordinates" in page.evaluate("nmm.plots.opened()")
    assert page.evaluate("nmm.player.playing") is False
    # A button that was pressed with the mouse does not keep the space bar.
    page.locator("#ghosts").click()
    page.keyboard.press("Space")
    assert page.evaluate("nmm.player.playing") is True
    assert page.locator("#ghosts").get_attribute("aria-pressed") == "false"
    page.keyboard.press("g")


def test_every_control_has_a_name(plotted: Plotted) -> None:
    controls = "button, select, input, canvas[role], summary, aside"
    unnamed = f"""() => [...document.querySelectorAll("body > :not(.dg) :is({controls})")]
      .filter((one) => !(one.getAttribute("aria-label") || one.textContent.trim()))
      .map((one) => one.outerHTML.slice(0, 80))"""
    assert plotted.page.evaluate(unnamed) == []
    assert (
        plotted.page.locator("#values th[scope=row]").count()
        == plotted.page.locator("#values tbody tr").count()
    )


@pytest.mark.parametrize("size", [(420, 800), (360, 640), (820, 600), (1100, 700)])
def test_nothing_is_cut_off(plotted: Plotted, size: tuple[int, int]) -> None:
    page = plotted.page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    try:
        draw_frames(page)
        assert page.evaluate(CUT) == []
        for part in ("#plots", "#values"):
            assert page.locator(part).evaluate("(part) => part.scrollWidth <= part.clientWidth")
        view, bar, dock = (page.locator(f"#{name}").bounding_box() for name in ("view", "bar", "plots"))
        assert view is not None
        assert bar is not None
        assert dock is not None
        # Beside one another on a wide window, one below another on a narrow one, the bar over no plot.
        beside = size[0] > 820
        assert (dock["x"] >= view["x"] + view["width"] - 1) is beside
        assert (dock["y"] >= view["y"] + view["height"] - 1) is not beside
        assert bar["y"] >= dock["y"] + dock["height"] - 1 or bar["x"] + bar["width"] <= dock["x"]
        assert view["height"] > 0.3 * size[1]
    finally:
        page.set_viewport_size({"width": 1000, "height": 640})


def test_dark_and_light_follow_the_reader(plotted: Plotted) -> None:
    page = plotted.page
    ground = """() => {
      const canvas = document.querySelector("[data-panel=H] canvas");
      return canvas.getContext("2d").getImageData(canvas.width - 30, canvas.height - 12, 1, 1).data[0];
    }"""
    colors = "nmm.runs.map((run) => run.color)"
    light = page.evaluate(colors)
    assert light == [resolver_styles()[name.lower()][0] for name in NAMES]
    assert page.evaluate(ground) == 255
    page.emulate_media(color_scheme="dark")
    draw_frames(page)
    assert page.evaluate(ground) == 0x11
    assert page.evaluate(colors) == light
    page.emulate_media(color_scheme="light")
    draw_frames(page)
    assert page.evaluate(ground) == 255


def test_without_webgl_the_page_says_so_and_plots(browser: Browser, opened: Plotted) -> None:
    page = browser.new_page()
    window = Window(page)
    page.on("pageerror", lambda error: window.errors.append(str(error)))
    page.add_init_script(
        "const { getContext } = HTMLCanvasElement.prototype;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {"
        "  return kind.startsWith('webgl') ? null : getContext.call(this, kind, ...rest); };"
    )
    window.open(f"{opened.url}#t=2")
    assert page.locator("#blind").is_visible()
    assert "WebGL" in page.locator("#blind").inner_text()
    blind = Plotted(page, opened.url, opened.arrays)
    assert blind.state()["t"] == 2.0
    page.mouse.click(*blind.place("H", 4.5))
    state = blind.state()
    assert state["t"] == pytest.approx(4.5, abs=0.03)
    assert state["runs"][2]["values"]["q1"] == pytest.approx(blind.wanted(state["t"])[2]["q1"], abs=1e-6)
    assert window.errors == []
    page.close()


# What has little to show, or much


def test_other_robots_ten_runs_and_one_sample(window: Window, runs: list[Trajectory], tmp_path: Path) -> None:
    motion = drive(hand_built_robot(tmp_path), duration=0.5, label="other robot")
    shown = [*[cut(runs[0], 20 + 3 * k) for k in range(8)], motion, cut(runs[1], 1)]
    window.page.set_viewport_size({"width": 900, "height": 500})
    page = window.open(write_html(shown, tmp_path / "page.html").as_uri())
    names = [one["name"] for one in page.evaluate("nmm.state()")["runs"]]
    assert names == ["RG", *[f"RG ({k})" for k in range(2, 9)], "other robot", "PG"]
    page.evaluate("nmm.seek(0.5)")
    values = [one["values"] for one in page.evaluate("nmm.state()")["runs"]]
    assert values[7]["objective"] > 0.0
    assert values[0]["objective"] is None  # it had ended
    assert "objective" not in values[8]
    assert values[9]["q1"] is None
    page.evaluate("nmm.seek(0)")
    assert page.evaluate("nmm.state()")["runs"][9]["values"]["q1"] == pytest.approx(runs[1].q[0, 3])


def test_a_curve_with_a_gap_and_a_thinned_one(window: Window, runs: list[Trajectory], tmp_path: Path) -> None:
    from test_channels import noisy

    trajectory = noisy(6000, 6.0)
    window.page.set_viewport_size({"width": 900, "height": 500})
    page = window.open(write_html([trajectory], tmp_path / "page.html").as_uri())
    assert "of 6,000 samples" in page.locator("#thinned").inner_text()
    inside = float(trajectory.t[3005])
    page.evaluate(f"nmm.seek({inside!r})")
    values = page.evaluate("nmm.state()")["runs"][0]["values"]
    assert values["error_ee.x"] is None
    assert values["q1"] == pytest.approx(np.interp(inside, trajectory.t, trajectory.q[:, 3]), abs=1e-3)
    page.evaluate(f"nmm.seek({float(trajectory.t[2000])!r})")
    assert page.evaluate("nmm.state()")["runs"][0]["values"]["sigma_min"] == 7.5


def test_one_sample_alone(window: Window, runs: list[Trajectory], tmp_path: Path) -> None:
    window.page.set_viewport_size({"width": 900, "height": 500})
    page = window.open(write_html([cut(runs[0], 1)], tmp_path / "page.html").as_uri())
    page.keyboard.press("Space")
    page.mouse.click(700, 150)
    assert page.evaluate("nmm.state().t") == 0
    assert page.evaluate("nmm.state()")["runs"][0]["values"]["q1"] == pytest.approx(runs[0].q[0, 3])
    assert page.locator("#slider").is_disabled()
