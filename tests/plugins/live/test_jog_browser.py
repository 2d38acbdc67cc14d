"""Hand and base of a driven robot, moved in a real browser by keys, a gamepad and a SpaceMouse.

Keys are real events; gamepads and SpaceMice are objects that look to the page like the browser's own.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from driven_pages import driven, opened
from playback_browser import Window, draw_frames, watched
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from playwright.sync_api import Browser, Page

import nmm
from nmm.base.arrays import Array
from nmm.plugins.live.driving import RobotSetup
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.jogging import Jogging
from nmm.plugins.live.driving.messages import Jog, Order, parsed


def ready(setup: RobotSetup) -> RobotSetup:
    """With all compiled that stands and moves it."""
    Jogging(Driven(setup))._making.result()  # type: ignore[union-attr]
    return setup


@pytest.fixture(scope="module")
def setup() -> RobotSetup:
    robot = nmm.load("unicycle_3r")
    q = robot.q({"theta": 0.7, "q1": 0.3, "q2": 0.8, "q3": 0.5})
    return ready(RobotSetup(robot, [nmm.Position("ee")], q))


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy page speaks late; what stops a robot here is what the page says, not that it says nothing."""
    monkeypatch.setattr("nmm.plugins.live.driving.jogging.VALID", 1e6)


def moves(page: Page, part: str) -> None:
    """Wait until it moves, or with "" until it stands."""
    page.wait_for_function(f"nmm.drive.jogs === '{part}'")


def hand(page: Page) -> Array:
    return np.array(page.evaluate("nmm.drive.targets[0].at"))


def stands(page: Page) -> None:
    """Pictures come, in all of which it is where it is."""
    moves(page, "")
    at, time = hand(page), page.evaluate("nmm.drive.time")
    page.wait_for_function(f"nmm.drive.time > {time} + 0.1")
    np.testing.assert_array_equal(hand(page), at)


def goes(page: Page, row: int, sign: int) -> None:
    """Wait until the hand has gone along an axis of the world, one way."""
    at = hand(page)[row]
    page.wait_for_function(f"{sign} * (nmm.drive.targets[0].at[{row}] - {at}) > 0.005")


def looked(page: Page) -> None:
    """Wait until the page has looked at its devices once more."""
    page.evaluate("""() => new Promise((done) => {
      const { devices } = nmm;
      const { read } = devices;
      devices.read = () => {
        devices.read = read;
        setTimeout(done);
        return read();
      };
    })""")


def in_world_axes(page: Page) -> None:
    page.get_by_role("button", name="the world's").click()
    assert page.get_by_role("button", name="the world's").get_attribute("aria-pressed") == "true"


#: Keeps what the page says.
SAY = """() => {
  const send = nmm.send;
  window.said = [];
  nmm.send = (message) => said.push(JSON.stringify(message)) && send(message);
}"""
KEYS = (("w", 0, 1), ("s", 0, -1), ("a", 1, 1), ("d", 1, -1), ("r", 2, 1), ("f", 2, -1))


def test_keys_move_the_hand_while_j_is_held_and_do_nothing_else(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        in_world_axes(page)
        grid = page.locator("#grid")
        page.evaluate(SAY)
        for key, row, sign in KEYS:
            page.keyboard.down("j")
            page.keyboard.down(key)
            moves(page, "hand")
            goes(page, row, sign)
            page.keyboard.up("j")  # the other key is still down
            stands(page)
            page.keyboard.up(key)
        page.keyboard.down("j")
        page.keyboard.press("x")  # a task of three rows does not turn, and the grid stays
        assert grid.get_attribute("aria-pressed") == "true"
        page.keyboard.up("j")
        page.keyboard.press("x")
        assert grid.get_attribute("aria-pressed") == "false"
        stands(page)
        messages = [parsed(text) for text in page.evaluate("window.said")]
        assert all(isinstance(one, Jog) and one.frame == "world" for one in messages)
        assert [one.moves for one in messages][-1] is False
        assert {max(map(abs, one.axes)) for one in messages} == {0.0, 1.0}  # type: ignore[union-attr]
        # The target was taken along, and is the mouse's again.
        np.testing.assert_allclose(page.evaluate("nmm.drive.targets[0].value"), hand(page), atol=1e-6)
        assert "stands where it was let go of" in page.locator("#told").inner_text()
        page.keyboard.press("ArrowRight")
        page.wait_for_function("!document.getElementById('told').textContent.includes('stands where')")


def test_keys_that_repeat_after_j_is_let_go_of_do_nothing(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        for key in ("j", "w", "t", "x"):
            page.keyboard.down(key)
        moves(page, "hand")
        page.evaluate(SAY)
        page.keyboard.up("j")
        for key in ("w", "t", "x"):
            page.keyboard.down(key)  # it has not come up: the system repeats it
        stands(page)
        assert "stands where it was let go of" in page.locator("#told").inner_text()
        assert page.locator("#grid").get_attribute("aria-pressed") == "true"
        assert {type(parsed(text)) for text in page.evaluate("said")} == {Jog}
        for key in ("w", "t", "x"):
            page.keyboard.up(key)
        page.keyboard.press("t")
        assert parsed(page.evaluate("said").pop()) == Order("here")


def test_j_b_and_o_leave_other_letters_to_the_page(window: Window, setup: RobotSetup) -> None:
    """As a keyboard's own layout has them: Colemak, Dvorak, a Cyrillic one."""
    with driven(setup) as url:
        page = opened(window, url)
        for code, key, meant in (
            ("KeyJ", "j", "KeyJ"), ("KeyJ", "N", None), ("KeyY", "j", "KeyJ"),
            ("KeyJ", "h", "KeyJ"), ("KeyC", "j", "KeyC"), ("KeyO", "r", None), ("KeyB", "x", None),
            ("KeyN", "b", "KeyB"), ("KeyS", "o", "KeyO"), ("KeyJ", "о", "KeyJ"), ("KeyW", "ц", "KeyW"),
        ):  # fmt: skip
            assert (
                page.evaluate("([code, key]) => nmm.devices.meant(code, key) ?? null", [code, key]) == meant
            )
        page.keyboard.down("j")
        assert page.evaluate("nmm.devices.meant('KeyS', 'o')") == "KeyS"
        page.keyboard.up("j")


@pytest.mark.parametrize("takes", ["contextmenu", "dragstart"])
def test_what_takes_the_keys_away_stops_it(window: Window, setup: RobotSetup, takes: str) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        for key in ("j", "w"):
            page.keyboard.down(key)
        moves(page, "hand")
        page.locator("canvas").first.click(button="right")  # the picture has no menu
        looked(page)
        assert page.evaluate("nmm.jog.moves") is True
        if takes == "contextmenu":
            page.locator("#told").click(button="right")
        else:
            page.locator("#told").dispatch_event("dragstart")
        stands(page)
        page.keyboard.down("j")  # it is repeated
        looked(page)
        assert page.evaluate("nmm.jog.held") is False
        for press in (page.keyboard.up, page.keyboard.down):
            for key in ("j", "w"):
                press(key)
        moves(page, "hand")
        for key in ("j", "w"):
            page.keyboard.up(key)


def test_a_key_pressed_where_one_writes_moves_nothing(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.get_by_label("ee: x in m, as a number").focus()
        page.keyboard.down("j")
        page.keyboard.down("w")
        assert page.evaluate("nmm.jog.held") is False
        page.keyboard.up("w")
        page.keyboard.up("j")


def test_shift_is_a_tenth_as_fast(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        for key in ("j", "Shift", "w"):
            page.keyboard.down(key)
        moves(page, "hand")
        assert page.evaluate("nmm.devices.read().axes") == [0.1, 0, 0, 0, 0, 0]
        for key in ("w", "Shift", "j"):
            page.keyboard.up(key)
        stands(page)


def test_the_base_drives_and_turns_and_its_arm_stays(window: Window, setup: RobotSetup) -> None:
    robot = setup.robot
    q = f"{json.dumps(robot.q_names)}.map((name) => nmm.state().runs[0].values[name])"
    with driven(setup) as url:
        page = opened(window, url)
        page.keyboard.press("b")
        page.wait_for_function("nmm.jog.part === 'base'")
        assert page.get_by_role("button", name="Base").get_attribute("aria-pressed") == "true"
        first = np.array(page.evaluate(q))
        page.keyboard.down("j")
        page.keyboard.down("a")  # sideways: it has wheels
        draw_frames(page)
        assert page.evaluate("[nmm.jog.held, nmm.jog.moves]") == [True, False]
        page.keyboard.up("a")
        page.keyboard.down("w")
        moves(page, "base")
        page.wait_for_function(f"Math.hypot({q}[0] - {first[0]}, {q}[1] - {first[1]}) > 0.05")
        page.keyboard.up("w")
        stands(page)
        page.wait_for_function("nmm.runs[0].t.at(-1) === nmm.drive.time")
        moved = np.array(page.evaluate(q)) - first
        np.testing.assert_allclose(np.arctan2(moved[1], moved[0]), 0.7, atol=1e-6)
        np.testing.assert_allclose(moved[2:], 0.0, atol=1e-9)
        page.keyboard.down("e")
        moves(page, "base")
        page.wait_for_function(f"{q}[2] < {first[2]} - 0.05")
        page.keyboard.up("e")
        page.keyboard.up("j")
        stands(page)
        np.testing.assert_allclose(page.evaluate(q)[3:], first[3:], atol=1e-9)
        idle = page.locator("#jog tr.idle th").all_text_contents()
        assert idle == ["left, right", "up, down", "tilt right, left", "tilt forward, back"]


#: A gamepad as a browser gives it: axes 0 and 1 of the left stick, 2 and 3 of the right one.
PLUG = """(mapping) => {
  window.pad = {
    id: "Test pad", index: 1, connected: true, mapping, axes: [0, 0, 0, 0],
    buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })),
  };
  navigator.getGamepads = () => [null, window.pad, null, null];
}"""
PRESS = "([k, pressed]) => { pad.buttons[k] = { pressed, value: Number(pressed) }; }"
PUSH = "(axes) => { pad.axes = axes; }"
L1, R1, R2, A, B = 4, 5, 7, 0, 1
REST = [0.0, 0.0, 0.0, 0.0]


def test_a_gamepad_moves_the_hand_while_its_button_is_held(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        in_world_axes(page)
        page.evaluate(PLUG, "standard")
        page.evaluate(PUSH, [0.9, -0.9, 0.0, -0.9])
        page.wait_for_function("document.getElementById('jogs').textContent.includes('Test pad')")
        draw_frames(page)
        assert page.evaluate("[nmm.jog.held, nmm.jog.moves]") == [False, False]
        page.evaluate(PUSH, REST)
        for button, axes, row, sign in (
            (L1, [0.0, -0.9, 0.0, 0.0], 0, 1), (R1, [0.0, 0.9, 0.0, 0.0], 0, -1),
            (L1, [-0.9, 0.0, 0.0, 0.0], 1, 1), (R1, [0.9, 0.0, 0.0, 0.0], 1, -1),
            (L1, [0.0, 0.0, 0.0, -0.9], 2, 1), (R1, [0.0, 0.0, 0.0, 0.9], 2, -1),
        ):  # fmt: skip
            page.evaluate(PRESS, [button, True])
            page.wait_for_function("nmm.jog.held")
            page.evaluate(PUSH, axes)
            moves(page, "hand")
            goes(page, row, sign)
            page.evaluate(PRESS, [button, False])  # the stick is still pushed
            stands(page)
            page.evaluate(PUSH, REST)
        # A stick that is let go of is never quite at 0.
        page.evaluate(PRESS, [L1, True])
        page.evaluate(PUSH, [0.05, -0.1, 0.11, 0.1])
        page.wait_for_function("nmm.jog.held")
        assert page.evaluate("nmm.devices.read().axes.every((share) => share === 0)")
        # From there on it begins slowly; a trigger makes it slower.
        page.evaluate(PUSH, [0.0, -0.56, 0.0, 0.0])
        assert page.evaluate("nmm.devices.read().axes[0]") == pytest.approx(0.5)
        page.evaluate(PRESS, [R2, True])
        assert page.evaluate("nmm.devices.read().axes[0]") == pytest.approx(0.05)
        page.evaluate(PRESS, [R2, False])
        moves(page, "hand")
        page.evaluate("() => { pad = null; }")  # unplugged
        stands(page)


def test_a_gamepad_of_unknown_layout_moves_nothing_and_is_told(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.evaluate(PLUG, "")
        page.evaluate(PUSH, [0.0, -1.0, -1.0, 0.0])
        page.evaluate(PRESS, [L1, True])
        told = "document.getElementById('jogs').textContent.includes('does not know')"
        page.wait_for_function(told)
        assert page.evaluate("[nmm.jog.held, nmm.jog.moves]") == [False, False]


def test_buttons_change_what_moves_and_along_whose_axes(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.evaluate(PLUG, "standard")
        for button, key, values in ((A, "part", ["base", "hand"]), (B, "frame", ["base", "world", "hand"])):
            for value in values:
                page.evaluate(PRESS, [button, True])
                page.wait_for_function(f"nmm.jog.{key} === '{value}'")
                page.evaluate(PRESS, [button, False])
                looked(page)
        page.evaluate(HIDE, True)  # what is pressed there is meant for another window
        page.evaluate(PRESS, [A, True])
        looked(page)
        page.evaluate(PRESS, [A, False])
        looked(page)
        page.evaluate(HIDE, False)
        looked(page)
        assert page.evaluate("nmm.jog.part") == "hand"
        # While something moves, another part does not begin to.
        page.evaluate(PRESS, [L1, True])
        page.evaluate(PUSH, [0.0, -0.9, 0.0, 0.0])
        moves(page, "hand")
        page.evaluate(PRESS, [A, True])
        page.wait_for_function("nmm.jog.part === 'base'")
        stands(page)
        assert page.evaluate("nmm.jog.held") is False
        page.evaluate(PRESS, [L1, False])
        looked(page)
        page.evaluate(PRESS, [L1, True])
        moves(page, "base")


#: What looks like the browser's devices, with a SpaceMouse that a page has to ask for.
HID = """() => {
  class Device extends EventTarget {
    constructor() {
      super();
      this.collections = [{ usagePage: 1, usage: 8 }];
      Object.assign(this, { productName: "Test mouse", opened: false });
    }
    async open() { this.opened = true; }
    report(reportId, numbers, bits) {
      const data = new DataView(new ArrayBuffer(bits === undefined ? 2 * numbers.length : 2));
      if (bits === undefined) numbers.forEach((x, k) => data.setInt16(2 * k, x, true));
      else data.setUint8(0, bits);
      this.dispatchEvent(Object.assign(new Event("inputreport"), { reportId, data }));
    }
  }
  const hid = Object.assign(new EventTarget(), {
    getDevices: async () => [],
    requestDevice: async (asked) => {
      window.asked = asked;
      return window.refused ? [] : [window.mouse];
    },
  });
  window.mouse = new Device();
  window.unplug = () => hid.dispatchEvent(Object.assign(new Event("disconnect"), { device: window.mouse }));
  Object.defineProperty(navigator, "hid", { value: hid });
}"""


@pytest.fixture
def with_mouse(browser: Browser) -> Iterator[Window]:
    page = browser.new_page()
    page.add_init_script(f"({HID})()")
    with watched(page) as window:
        yield window
    page.close()


def capped(page: Page, six: list[int], *, new: bool) -> None:
    """The cap is where these numbers say: right, towards the user, down, and the turns about these."""
    if new:
        page.evaluate("(six) => mouse.report(1, six)", six)
    else:
        page.evaluate("(six) => { mouse.report(1, six.slice(0, 3)); mouse.report(2, six.slice(3)); }", six)


@pytest.mark.parametrize("new", [False, True], ids=["two reports", "one report"])
def test_a_spacemouse_moves_the_hand_as_its_cap_goes(
    with_mouse: Window, setup: RobotSetup, new: bool
) -> None:
    with driven(setup) as url:
        page = opened(with_mouse, url)
        in_world_axes(page)
        page.evaluate("nmm.devices.VALID = 1e9")  # this one reports once
        page.locator("#spacemouse").click()
        page.wait_for_function("document.getElementById('jogs').textContent.includes('Test mouse')")
        assert page.evaluate("window.asked") == {"filters": [{"usagePage": 1, "usage": 8}]}
        axes = np.zeros((6, 6))
        for k in range(6):
            capped(page, [350 if i == k else 0 for i in range(6)], new=new)
            axes[k] = page.evaluate("nmm.devices.read().axes")
        # Right, back and down are -y, -x and -z of a robot (REP-103); the turns are about the same axes.
        swapped = -np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        np.testing.assert_allclose(axes, np.kron(np.eye(2), swapped), atol=1e-12)
        capped(page, [0, -350, 0, 0, 0, 0], new=new)
        draw_frames(page)
        assert page.evaluate("[nmm.jog.held, nmm.jog.moves]") == [False, False]
        page.evaluate("mouse.report(3, [], 1)")
        moves(page, "hand")
        goes(page, 0, 1)
        capped(page, [0, 0, -350, 0, 0, 0], new=new)
        goes(page, 2, 1)
        page.evaluate("mouse.report(3, [], 0)")
        stands(page)
        page.evaluate("mouse.report(3, [], 2)")
        page.wait_for_function("nmm.jog.part === 'base'")
        page.evaluate("mouse.report(3, [], 0)")
        capped(page, [0, -350, 0, 0, 0, 0], new=new)
        looked(page)
        page.evaluate("mouse.report(3, [], 1)")
        moves(page, "base")
        page.evaluate("nmm.devices.VALID = 250")  # as if it had no power
        stands(page)
        page.evaluate("nmm.devices.VALID = 1e9")
        capped(page, [0, -350, 0, 0, 0, 0], new=new)
        assert page.evaluate("nmm.devices.read().held") is False  # its button was not seen to come up
        stands(page)
        page.evaluate("mouse.report(3, [], 1)")
        moves(page, "base")
        page.evaluate("unplug()")
        stands(page)
        assert page.evaluate("nmm.devices.mice.length") == 0


def test_a_spacemouse_that_is_not_chosen_is_no_fault(with_mouse: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(with_mouse, url)
        page.evaluate("window.refused = true")
        page.locator("#spacemouse").click()
        page.wait_for_function("window.asked !== undefined")
        page.evaluate("() => { refused = false; mouse.open = async () => { throw new Error('in use'); }; }")
        page.locator("#spacemouse").click()
        page.get_by_text("The SpaceMouse cannot be opened: in use").wait_for()


HIDE = """(hidden) => {
  Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}"""
BLUR = """(away) => {
  document.hasFocus = () => !away;
  window.dispatchEvent(new Event(away ? "blur" : "focus"));
}"""


@pytest.mark.parametrize("away", [HIDE, BLUR], ids=["hidden", "without the focus"])
@pytest.mark.parametrize("holds", ["keys", "gamepad"])
def test_a_page_that_nobody_looks_at_stops_it(
    window: Window, setup: RobotSetup, away: str, holds: str
) -> None:
    """It moves again when what was held has been let go of."""

    def hold(on: bool) -> None:
        if holds == "keys":
            for key in ("j", "w"):
                (page.keyboard.down if on else page.keyboard.up)(key)
        else:
            page.evaluate(PUSH, [0.0, -0.9 if on else 0.0, 0.0, 0.0])
            page.evaluate(PRESS, [L1, on])

    with driven(setup) as url:
        page = opened(window, url)
        page.evaluate(PLUG, "standard")
        hold(True)
        moves(page, "hand")
        page.evaluate(away, True)
        stands(page)
        page.evaluate(away, False)
        if holds == "keys":
            page.keyboard.down("j")  # a key that is held is repeated
        stands(page)
        assert page.evaluate("nmm.jog.held") is False
        hold(False)
        looked(page)
        hold(True)
        moves(page, "hand")
        hold(False)
        stands(page)


def test_a_page_that_is_closed_stops_it(browser: Browser, window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        first = opened(window, url)
        page = browser.new_page()
        with watched(page) as other:
            second = opened(other, url)
            for key in ("j", "w"):
                second.keyboard.down(key)
            moves(second, "hand")
            moves(first, "hand")
            # Who does not hold it does not stop it, either.
            for key in ("j", "s"):
                first.keyboard.down(key)
            first.keyboard.up("j")
            first.keyboard.up("s")
            time = first.evaluate("nmm.drive.time")
            first.wait_for_function(f"nmm.drive.time > {time} + 0.1")
            assert first.evaluate("nmm.drive.jogs") == "hand"
            second.evaluate("nmm.send = () => true")  # it says nothing more
        page.close()
        stands(first)


def test_a_page_that_says_nothing_stops_it(
    window: Window, setup: RobotSetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        at = hand(page)
        for key in ("j", "w"):
            page.keyboard.down(key)
        gone = (
            f"Math.hypot(...nmm.drive.targets[0].at.map((x, i) => x - {json.dumps(at.tolist())}[i])) > 0.01"
        )
        page.wait_for_function(gone)
        page.evaluate("nmm.send = () => true")
        moves(page, "hand")
        monkeypatch.setattr("nmm.plugins.live.driving.jogging.VALID", 0.25)
        stands(page)
        for key in ("j", "w"):
            page.keyboard.up(key)


def test_speeds_are_chosen_in_the_page(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.get_by_text("Jog speeds").click()
        slider = page.locator('input[data-key="jog.linear"]')
        slider.fill(str(np.log(0.1)))
        slider.dispatch_event("change")
        page.wait_for_function(
            """document.querySelector('input[data-key="jog.linear"]').nextSibling.textContent === '0.100'"""
        )


def test_without_a_hand_the_base_moves_and_the_page_fits(window: Window) -> None:
    robot = nmm.load("unicycle_3r")
    with driven(ready(RobotSetup(robot, [nmm.Posture("q1")], robot.rest))) as url:
        page = opened_without_gizmo(window, url)
        assert page.get_by_role("button", name="Hand").is_disabled()
        for key in ("j", "w"):
            page.keyboard.down(key)
        moves(page, "base")
        for key in ("j", "w"):
            page.keyboard.up(key)
        moves(page, "")
        page.set_viewport_size({"width": 420, "height": 800})
        page.get_by_text("What moves what").click()
        outside: Any = page.evaluate(
            """() => [...document.querySelectorAll("#jog *")]
              .filter((part) => part.offsetParent && part.getBoundingClientRect().right > 421)
              .map((part) => part.outerHTML)"""
        )
        assert outside == []
        assert page.evaluate("document.documentElement.scrollWidth") <= 420


def opened_without_gizmo(window: Window, url: str) -> Page:
    page = window.open(url)
    page.wait_for_function("nmm.drive.targets.length > 0 && nmm.drive.time > 0")
    return page


def test_what_moves_what_is_told_for_each_device(window: Window, setup: RobotSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.get_by_text("What moves what").click()
        rows = page.locator("#jog tbody tr").all_inner_texts()
        assert [row.split("\t")[:2] for row in rows] == [
            ["hold to move", "J"], ["a tenth as fast", "Shift"], ["hand or base", "B"], ["whose axes", "O"],
            ["forward, back", "W, S"], ["left, right", "A, D"], ["up, down", "R, F"],
            ["tilt right, left", "C, X"], ["tilt forward, back", "T, G"], ["turn left, right", "Q, E"],
        ]  # fmt: skip
        assert all(row.count("\t") == 3 for row in rows)
