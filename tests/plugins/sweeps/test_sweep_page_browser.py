"""The page of a sweep in a real browser: filters that hold everywhere, a rollout that opens."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playback_browser import browser as browser
from playwright.sync_api import Browser, Page
from short_scenario import MINIMAL

import nmm
from nmm.base.resolver_style import resolver_styles


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> nmm.extending.SweepResult:
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "short.yaml").write_text(MINIMAL, encoding="utf-8")
    vary = {"q0.x": (-1, 1), "resolver.kind": ["pg", "rg"], "resolver.threshold": [0.01, 0.02]}
    return nmm.Sweep(folder / "short.yaml", vary, samples=20).run(folder / "out", jobs=1)


@pytest.fixture
def page(browser: Browser, swept: nmm.extending.SweepResult) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1100, "height": 900})
    made = context.new_page()
    wrong: list[str] = []
    made.on("pageerror", lambda error: wrong.append(str(error)))
    made.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    made.on(
        "request", lambda request: wrong.append(request.url) if request.url != swept.page.as_uri() else None
    )
    made.goto(swept.page.as_uri())
    yield made
    assert wrong == []
    context.close()


def shown(page: Page) -> int:
    return int(page.inner_text("#count").split()[0])


def test_filters_of_the_table_hold_everywhere(page: Page, swept: nmm.extending.SweepResult) -> None:
    rows = swept.table.to_pylist()
    assert shown(page) == 80
    page.fill("thead input[data-column='q0.x']", "0..0.5")
    assert shown(page) == sum(0.0 <= row["q0.x"] <= 0.5 for row in rows)
    page.get_by_role("button", name="40 refused").click()
    left = [row for row in rows if 0.0 <= row["q0.x"] <= 0.5 and row["outcome"] == "completed"]
    assert shown(page) == len(left)
    assert page.locator("tbody tr").count() == min(50, len(left))
    page.get_by_role("button", name="error_rms").click()
    columns = page.locator("thead tr:first-child th").all_inner_texts()
    first = page.locator("tbody tr").first.locator("td").nth(columns.index("error_rms [m]")).inner_text()
    assert float(first) == pytest.approx(min(row["error_rms"] for row in left), rel=1e-3)
    page.get_by_role("button", name="Clear all filters").click()
    assert shown(page) == 80


def test_a_brush_filters_and_a_click_lets_it_go(page: Page, swept: nmm.extending.SweepResult) -> None:
    page.locator("#parallel").scroll_into_view_if_needed()
    box = page.locator("#parallel").bounding_box()
    assert box is not None
    axis = page.evaluate("parallel.axes[0].x")
    middle = page.evaluate("parallel.axes[0].place(0)")
    x = box["x"] + axis
    page.mouse.move(x, box["y"] + 40)
    page.mouse.down()
    page.mouse.move(x, box["y"] + middle, steps=4)
    page.mouse.up()
    values = swept.table["q0.x"].to_pylist()
    assert abs(shown(page) - sum(value > 0.0 for value in values)) <= 4  # a pixel may hold a point
    page.mouse.click(x, box["y"] + 100)
    assert shown(page) == 80


def test_a_click_opens_the_rollout_with_the_command_that_runs_it(
    page: Page, swept: nmm.extending.SweepResult
) -> None:
    page.select_option("#y", "error_rms")
    x, y = page.evaluate("points.places[6]")
    page.locator("#points").click(position={"x": x, "y": y})
    command = page.inner_text("#one pre").split()
    index = int(page.inner_text("#one h2").split()[1].rstrip(":"))
    assert page.evaluate("chosen") == index
    told = dict(zip(*(page.locator(f"#one {part}").all_inner_texts() for part in ("dt", "dd")), strict=True))
    assert [told[name].split()[1] for name in ("q0.x", "error_rms", "u_max.omega")] == ["m", "m", "rad/s"]
    settings = dict(word.split("=", 1) for word in command if "=" in word)
    row = swept.table.to_pylist()[index]
    assert float(settings["q0.x"]) == row["q0.x"]
    run = nmm.Scenario.load(command[2], settings).run()
    assert run.summary()["error_rms"] == row["error_rms"]


def test_a_resolver_has_the_colour_of_its_runs_and_pairs_of_dots_a_key(
    page: Page, swept: nmm.extending.SweepResult
) -> None:
    page.select_option("#colour", "resolver.kind")
    kinds = [row["resolver.kind"] for row in swept.table.to_pylist()]
    found = page.evaluate("[...Array(N).keys()].map(colouring(byName.get('resolver.kind')).of)")
    assert found == [resolver_styles()[kind][0] for kind in kinds]
    page.select_option("#x", "q0.x")
    for up in ("q0.x", "error_rms"):  # all resolvers' errors are one where no limit is met
        page.select_option("#y", up)
        assert "pg and 0.01, pg and 0.02, rg and 0.01, rg and 0.02" in page.inner_text("#legend")
        assert len(set(page.evaluate("points.places.slice(0, 4).map(([x]) => x)"))) == 4


def test_a_logarithmic_axis_has_round_numbers(page: Page) -> None:
    """As many as there is room for, within a part of a decade and over many."""
    for low, high in ((0.3, 1.4), (17.0, 37.0), (1.0, 90.0), (2e-4, 5e3), (1e-12, 1.0)):
        found = page.evaluate(f"decades(Math.log10({low}), Math.log10({high}), 8)")
        assert 3 <= len(found) <= 12
        assert low <= found[0] * (1 + 1e-9)
        assert found[-1] <= high * (1 + 1e-9)
        assert all(float(f"{mark:.2g}") == pytest.approx(mark, rel=1e-9) for mark in found)


def test_a_logarithmic_axis_leaves_out_nothing(page: Page) -> None:
    """A start from -1 m to 1 m, chosen where the axis before was logarithmic."""
    page.select_option("#x", "effort")
    page.set_checked("#log-x", True)
    page.select_option("#x", "q0.x")
    assert page.locator("#log-x").is_disabled()
    assert page.evaluate("points.places.every(([x]) => !Number.isNaN(x))")
    page.select_option("#x", "effort")
    assert page.locator("#log-x").is_enabled()


def test_a_dot_of_the_front_keeps_its_colour(page: Page) -> None:
    page.select_option("#colour", "resolver.kind")
    page.set_checked("#front", True)
    drawn, wanted = page.evaluate(
        """() => {
          const row = frontOf(numbersOf(byName.get($("x").value)), numbersOf(byName.get($("y").value)))[0];
          const [x, y] = points.places[row].map((place) => Math.round(place * devicePixelRatio));
          const pen = points.canvas.getContext("2d");
          const of = (data) => [...data].slice(0, 3);
          const drawn = of(pen.getImageData(x, y, 1, 1).data);
          pen.fillStyle = colouring(byName.get("resolver.kind")).of(row);
          pen.fillRect(0, 0, 4, 4);
          return [drawn, of(pen.getImageData(1, 1, 1, 1).data)];
        }"""
    )
    assert drawn == pytest.approx(wanted, abs=12)


def test_details_stand_beside_the_plot_and_within_the_window(page: Page) -> None:
    page.locator("tbody tr").first.click()
    plot, one = (page.locator(name).bounding_box() for name in ("#points", "#one"))
    assert plot is not None
    assert one is not None
    assert one["x"] >= plot["x"] + plot["width"]
    assert one["y"] >= 0.0
    assert one["y"] + one["height"] <= 900.0


@pytest.mark.parametrize("width", [420, 1400])
def test_it_fits_its_window(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= width
