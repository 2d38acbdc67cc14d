"""A page by both of its server's names, and before it has been told anything, in a real browser."""

from __future__ import annotations

from playback_browser import Window, draw_frames
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playwright.sync_api import Browser
from ports import MOST

from nmm.model.robots.robot import Robot
from nmm.plugins.live.server import PageServer
from nmm.views.playback import LiveViewer
from nmm.views.playback.html import socket_page


def test_a_page_by_the_name_of_this_machine_is_told_all_the_same(
    browser: Browser, small_robot: Robot
) -> None:
    page = browser.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: message.type == "error" and complaints.append(message.text))
    with LiveViewer(small_robot) as viewer:
        page.goto(viewer.url.replace("127.0.0.1", "localhost"))
        page.wait_for_function("!document.body.classList.contains('loading')", timeout=1000.0 * MOST)
        q = [0.7, *[0.0] * (small_robot.n - 1)]
        viewer.display(q)
        page.wait_for_function("nmm.node('/nmm/motion 0/robot/x').position.x === 0.7")
        # Another server's page is not listened to by either name.
        port = viewer.url.rsplit(":", 1)[1].strip("/")
        closed = """(url) => new Promise((done) => {
          const socket = new WebSocket(url);
          socket.onopen = () => done("open");
          socket.onerror = () => done("closed");
        })"""
        token = page.evaluate("document.body.dataset.token")
        stranger = browser.new_page()
        for name in ("localhost", "127.0.0.1"):
            assert stranger.evaluate(closed, f"ws://{name}:{port}/socket?token={token}") == "closed"
        stranger.close()
    page.close()
    assert complaints == []


def test_before_there_is_a_scene_there_is_no_run(window: Window) -> None:
    """The server has the page and not yet anything to tell it: it answers, and takes another size."""
    server = PageServer(
        lambda host, token: socket_page("empty", host, token), ['{"type": "places", "transforms": []}']
    )
    try:
        heard: list[object] = []
        window.page.on(
            "websocket", lambda socket: socket.on("framereceived", lambda frame: heard.append(frame))
        )
        window.page.goto(server.url)
        while not heard:  # a page that is closed while it connects complains
            window.page.wait_for_timeout(20)
        assert window.page.evaluate("nmm.state()") == {"t": 0, "runs": []}
        window.page.evaluate("nmm.seek(1.5)")
        window.page.set_viewport_size({"width": 400, "height": 320})
        draw_frames(window.page)
        assert window.page.evaluate("[nmm.viewer.renderer.domElement.clientWidth, innerWidth]") == [400, 400]
        assert window.page.evaluate("nmm.state()") == {"t": 0, "runs": []}
    finally:
        server.close()
