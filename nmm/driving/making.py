"""A controller that is made in a thread, while another one goes on."""

from __future__ import annotations

import threading

from nmm.control.controller import Controller
from nmm.driving.choices import Choice
from nmm.driving.driven import Driven
from nmm.driving.setups import Settings
from nmm.errors import NmmError


class Making:
    """A controller that is made in a thread: a kind of resolver that is new to this machine is compiled."""

    def __init__(self, driven: Driven, key: str, value: object) -> None:
        self.made: tuple[Settings, Controller, list[Choice]] | None = None
        self.wrong = ""
        self.done = False
        threading.Thread(target=self._make, args=(driven, key, value), daemon=True).start()

    def _make(self, driven: Driven, key: str, value: object) -> None:
        try:
            made = driven.with_choice(key, value)
            self._first_step(made[1], driven)
            self.made = made
        except NmmError as error:
            self.wrong = str(error)
        except Exception as error:  # a thread's end nobody sees
            self.wrong = f"{type(error).__name__}: {error}"
        self.done = True

    @staticmethod
    def _first_step(controller: Controller, driven: Driven) -> None:
        """The first call compiles."""
        try:
            controller.step(driven.t, driven.q, driven.setup.dt)
        except NmmError:
            return  # the loop will see, and say so
        finally:
            controller.reset()
