"""What all pages share that are open while something happens: the clock, messages, the end."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from ports import listening

import nmm
from nmm.base.errors import InputError
from nmm.plugins.live import session
from nmm.plugins.live.session import FPS, LATE, Clock, Session, message
from nmm.views.playback.rolling import RolledRobot, Rolling

KINDS = {"aim": ("task", "value"), "go": ()}


class Seconds:
    """A clock that tests set; resting until a picture is due moves it on."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def seconds(monkeypatch: pytest.MonkeyPatch) -> Seconds:
    found = Seconds()
    monkeypatch.setattr(session, "time", found)
    return found


def test_pictures_are_a_thirtieth_of_a_second_apart_whatever_they_take(seconds: Seconds) -> None:
    clock, began = Clock(), seconds.now
    for k in range(30):
        clock.passed()
        seconds.now += 0.03 * (k % 2)
        clock.rest(seconds)
    assert seconds.now - began == pytest.approx(1.0)
    assert (clock.late, clock.lost) == (0, 0)


def test_a_late_picture_counts_those_that_were_due_meanwhile(seconds: Seconds) -> None:
    clock = Clock()
    clock.passed()
    seconds.now += 0.2
    clock.rest(seconds)
    assert clock.passed() == pytest.approx(0.2)
    clock.rest(seconds)
    assert clock.late == int((0.2 - 1.0 / FPS) * FPS)
    clock.rest(seconds, stands=True)
    assert clock.late == int((0.2 - 1.0 / FPS) * FPS)


def test_pictures_made_and_late_are_all_that_were_due(seconds: Seconds) -> None:
    """Whatever each takes: no part of a picture's time is lost from one to the next."""
    clock, began = Clock(), seconds.now
    taken = [*np.random.default_rng(5).uniform(0.0, 0.2, 200), *np.zeros(10)]  # in time again at the end
    for each in taken:
        clock.passed()
        seconds.now += each
        clock.rest(seconds)
    assert len(taken) + clock.late == pytest.approx((seconds.now - began) * FPS, abs=1e-6)
    assert clock.late > 200


def test_time_beyond_what_is_late_is_let_go_and_counted(seconds: Seconds) -> None:
    clock = Clock()
    seconds.now += LATE + 0.75
    assert clock.passed() == pytest.approx(1.0 / FPS)
    assert clock.lost == round((LATE + 0.75) * FPS) - 1
    seconds.now += 5.0
    clock.stand()
    assert clock.passed() == 0.0


def test_after_time_that_is_let_go_pictures_begin_anew(seconds: Seconds) -> None:
    """The next one is a whole picture's time later, as the clock itself goes on by one."""
    clock = Clock()
    clock.passed()
    clock.rest(seconds)
    seconds.now += LATE + 0.75 / FPS
    shown, late = clock.passed(), clock.late
    clock.rest(seconds)
    assert clock.passed() == pytest.approx(1.0 / FPS) == shown
    assert clock.late - late == int((LATE + 0.75 / FPS) * FPS)


def test_messages_have_a_known_type_and_exactly_its_keys() -> None:
    assert message('{"type":"aim","task":0,"value":[1]}', KINDS) == {"type": "aim", "task": 0, "value": [1]}
    assert message(b'{"type":"go"}', KINDS) == {"type": "go"}
    for text in (
        "",
        "[",
        "[]",
        "null",
        "[" * 10_000,
        b"\xff",
        "{}",
        '{"type":3}',
        '{"type":["go"]}',
        '{"type":"no"}',
    ):
        with pytest.raises(InputError) as refused:
            message(text, KINDS)
        assert refused.value.where == "message"
    for text in ('{"type":"go","more":1}', '{"type":"aim","task":0}'):
        with pytest.raises(InputError) as refused:
            message(text, KINDS)
        assert refused.value.where.startswith("message ")


def test_however_it_ends_its_thread_and_its_port_are_gone(capsys: pytest.CaptureFixture[str]) -> None:
    for ends in (KeyboardInterrupt, ValueError, None):
        ended, told = threading.Event(), []
        page = Session("title", [])
        port = int(page.url.rsplit(":", 1)[1].strip("/"))
        assert port in listening()
        page.begin(lambda page=page, ended=ended: (page.ended.wait(), ended.set()), "nmm test")
        try:
            with page.ending(lambda told=told: told.append("last")):
                if ends is not None:
                    raise ends
        except ValueError:
            assert ends is ValueError
        assert ended.is_set()
        assert told == ["last"]
        assert port not in listening()
        page.close()
    assert capsys.readouterr().out == "\n"  # after the ^C of a terminal


def test_a_robot_rolls_on_from_where_it_is() -> None:
    robot = nmm.load("unicycle_2r")
    way = np.linspace(robot.rest, robot.q({"x": 0.7}), 9)
    shown = RolledRobot(robot, way[0])
    shown.roll(way[1:4])
    shown.roll(way[4:])
    np.testing.assert_array_equal(shown.now[0], way[-1])
    np.testing.assert_allclose(shown.now[1], Rolling(robot).angles(way)[-1], atol=1e-12)
    shown.stand(way[0])
    np.testing.assert_array_equal(shown.now[1], 0.0)
