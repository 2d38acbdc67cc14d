"""nmm run --stream: runs shown by other tools, or recorded for them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from nmm.base.errors import InputError, NmmError, expect_known
from nmm.base.files import replaceable
from nmm.base.plugins import Beside, OptionGroup
from nmm.cli.interrupts import shielded
from nmm.cli.options import option
from nmm.cli.output import show_text, warn
from nmm.plugins.streams.tools import PORTS, RERUN, SUFFIXES, expect_installed

if TYPE_CHECKING:
    from nmm.plugins.streams.run_stream import RunStream

WHERE = "--stream"


class Wanted(NamedTuple):
    """A tool, the file to write, None for live, and the port then."""

    tool: str
    file: Path | None
    port: int


def wanted(text: str) -> Wanted:
    """TOOL, TOOL:PORT or TOOL=FILE; else `InputError`."""
    where, given, file = text.partition("=")
    tool, asked, number = where.partition(":")
    expect_known("tool", tool, PORTS, WHERE)
    suffix = SUFFIXES[tool]
    port = int(number[:6]) if number.isdecimal() else PORTS[tool]  # more digits are too many
    if (asked and (given or not number.isdecimal() or port > 65535)) or (
        given and Path(file).suffix != suffix
    ):
        expected = f"{tool}, {tool}:PORT or {tool}=FILE{suffix}"
        raise InputError(where=WHERE, expected=expected, got=text)
    if given:
        replaceable(Path(file))
    expect_installed(tool)
    return Wanted(tool, Path(file) if given else None, port)


@dataclass(frozen=True)
class StreamOptions(OptionGroup):
    """Tools that show the run."""

    stream: list[str] | None = option(
        "TOOL[=FILE]",
        "Show the run in rerun or foxglove while it is computed, in its own time, or write it for them: "
        "rerun=FILE.rrd, foxglove=FILE.mcap. rerun:PORT and foxglove:PORT are other ports than 9876 of a "
        "viewer and 8765 of the server. May be repeated.",
    )

    def check(self) -> None:
        for text in self.stream or ():
            one = wanted(text)
            if one.tool == RERUN and one.file is None:  # before a plan is made, which takes long
                from nmm.plugins.streams.sending import expect_viewer

                expect_viewer(one.port)

    @contextmanager
    def beside(self, scenario: Any, controller: Any) -> Iterator[Beside]:
        several = [wanted(text) for text in self.stream or ()]
        live = [one for one in several if one.file is None]
        with ExitStack() as stack:
            streams = [
                stack.enter_context(run_stream(scenario, controller, one)) for one in live
                if not scenario.parts.moved_by
            ]  # fmt: skip
            for shown in streams:
                told = "waits for Foxglove at" if shown.tool == "foxglove" else "goes to"
                show_text(f"the stream {told} {shown.address}")
            yield Streams(several, streams)


def run_stream(scenario: Any, controller: Any, one: Wanted) -> RunStream:
    from nmm.plugins.streams.run_stream import RunStream
    from nmm.plugins.streams.streaming import RATE

    robot, parts = controller.robot, scenario.parts
    disturbed = None if parts.disturbances is None else parts.disturbances.make()
    return RunStream(
        controller,
        robot.following.placed(robot.q(parts.q0)),
        f"{scenario.title or scenario.name}, {controller.resolver.name.upper()}",
        one.tool,
        one.port,
        RATE,
        believed=disturbed is not None and (disturbed.odometry or disturbed.localisation is not None),
        surroundings=scenario.surroundings(robot),
    )


class Streams(Beside):
    """The streams of one run: live ones while it is computed, files in the end."""

    def __init__(self, several: list[Wanted], live: list[RunStream]) -> None:
        self._several, self._live = several, live

    def watch(self, recorder: Any) -> None:
        for shown in self._live:
            shown.watch(recorder)

    def end(self, run: Any, asked: bool) -> None:
        from nmm.plugins.streams.streaming import stream

        broken: list[NmmError] = []
        for one in self._several if len(run) else ():
            if one.file is not None:
                try:
                    with shielded():
                        written = stream(run, one.tool, file=one.file)
                    show_text(f"written for {one.tool}: {written.file}")
                except NmmError as error:  # it keeps no other one back
                    broken.append(error)
        if not asked:
            self._show(run)
        for other in broken[1:]:
            warn(str(other))
        if broken:
            raise broken[0]

    def _show(self, run: Any) -> None:
        """Show live streams to their end; a planned motion is shown now."""
        from nmm.plugins.streams.streaming import stream

        shown_runs: list[Any] = [*self._live]
        try:
            for shown in self._live:
                shown.end(run)
            for one in self._several if not self._live and len(run) else ():
                if one.file is None:  # a planned motion
                    shown_runs.append(stream(run, one.tool, port=one.port))
        except KeyboardInterrupt:
            return
        for shown in shown_runs:
            if shown.trouble:
                warn(f"the stream to {shown.tool}: {shown.trouble}")
