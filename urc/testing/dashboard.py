"""A fake robot for the dashboard: profiles with widgets, and a session without a transport."""

from collections.abc import AsyncIterator, Callable, Collection, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, get_args

import yaml

from urc.guard.goal_reports import GoalReports
from urc.model.driver import Command, Driver, TransportSpec
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.payload import Payload
from urc.model.profile import Profile, Setting
from urc.model.values import Alarm, AlarmLimits, Reading, Sample, Signal, SignalType, Value
from urc.model.widget import Widget, WidgetPort
from urc.protocol.events import MotionEvent, Replied
from urc.protocol.sequences.sequence_control import Pull
from urc.runtime.clock import Clock, LoopClock
from urc.runtime.hub import Hub, LinkState, LinkStatus, LogEntry
from urc.runtime.motion_controller import MotionBackend
from urc.shipped import shipped
from urc.testing.movers import FakeFrames, FakeMotionBackend

__all__ = ["FakeRobot", "dashboard_profile", "option_defaults", "plain_widget"]

BATTERY = Signal(
    "battery",
    "integer",
    unit="%",
    min=0,
    max=100,
    limits=AlarmLimits(lolo=10, low=20),
    stale_after_s=3.0,
)


@lru_cache(maxsize=64)  # profiles share a few manifests
def _declared(manifest: str) -> Any:
    return yaml.safe_load(manifest)


def plain_widget(name: str, inputs: Sequence[str], folder: Path | None = None) -> Widget:
    """Return a widget that accepts any type, from the shipped folder `name` or from `folder`."""
    place = folder or shipped("widgets") / name
    manifest = place / "widget.yaml"
    declared = _declared(manifest.read_text("utf-8")) if manifest.is_file() else {}
    types = get_args(SignalType)
    known = declared.get("inputs", {})
    ports = {
        each: WidgetPort(
            each,
            types,
            unit=known.get(each, {}).get("unit", ""),
            is_required=known.get(each, {}).get("required", True),
            is_multiple=known.get(each, {}).get("multiple", False),
            keeps_all=known.get(each, {}).get("keep_all", False),
        )
        for each in {**known, **dict.fromkeys(inputs)}
    }
    outputs = {
        each: WidgetPort(
            each, is_held=port.get("hold", False), arguments=tuple(port.get("arguments", {}))
        )
        for each, port in declared.get("outputs", {}).items()
    }
    made = Widget(name, name.title(), place, ports, outputs, options=declared.get("options", {}))
    return made._replace(footprint=declared.get("footprint", made.footprint))


def option_defaults(widget: Widget) -> dict[str, object]:
    """Return the default of each option in the widget's manifest, as the document loader does."""
    return {
        name: schema["default"]
        for name, schema in widget.options.items()
        if isinstance(schema, Mapping) and "default" in schema
    }


def dashboard_profile(
    *,
    name: str = "puppet",
    signals: Mapping[str, Signal] | None = None,
    uses: Sequence[WidgetUse] = (),
    widgets: Sequence[Widget] = (),
    settings: Mapping[str, Setting] | None = None,
    commands: Mapping[str, Command] | None = None,
) -> Profile:
    """Return a profile with all slots in one row; by default, it shows the puppet's battery signal.

    A widget's missing options take the defaults from its manifest.
    """
    wanted = uses or (WidgetUse("battery", "battery", {"level": "battery"}),)
    known = {each.name: each for each in widgets}
    for use in wanted:
        known.setdefault(use.widget, plain_widget(use.widget, (*use.inputs, *use.lists)))
    given = [
        use._replace(options={**option_defaults(known[use.widget]), **use.options})
        for use in wanted
    ]
    slots = tuple(Slot(use.slot, 0, column) for column, use in enumerate(given))
    grid = Layout(1, len(slots), slots)
    return Profile(
        name=name,
        title=name.title(),
        file=f"{name}.yaml",
        summary="A robot that does not exist.",
        settings={"host": Setting("host", "host", default="127.0.0.1")}
        if settings is None
        else settings,
        driver=Driver(
            {"wire": TransportSpec("wire", "tcp")},
            signals or {"battery": BATTERY},
            commands=commands or {},
        ),
        slots={use.slot: use for use in given},
        interfaces={"default": Interface("default", "Default", {"landscape": grid})},
        widgets=known,
    )


class FakeRobot:
    """A fake session; the test sets its state and replies. The session counts calls to `open`."""

    def __init__(self, profile: Profile, clock: Clock | None = None) -> None:
        self.profile = profile
        self.clock: Clock = clock or LoopClock()
        self.hub = Hub(profile.driver.signals)
        self.opened = 0
        self.is_open = False
        self.commands: list[tuple[str, dict[str, Reading]]] = []
        self.confirmed_by: list[tuple[str, ...]] = []
        """Names of the people who confirmed each command."""
        self.pulls: list[tuple[str, Pull]] = []
        """Requests about sequences."""
        self.reconnects = 0
        self.goals = GoalReports(("wire",))
        """Reports about goals, made by the test."""
        self.payloads: dict[str, Payload] = {}
        """Sent frame of each command, instead of the command's name."""
        """Number of calls of `reconnect` so far."""
        self.latched: list[str] = []
        """Reasons for all latched stops, in order."""
        self.ended: list[tuple[str, ...]] = []
        """Actions whose cancellations each reset has ended."""
        self.frames = FakeFrames(profile.driver)
        self.backend: MotionBackend | None = FakeMotionBackend(self.clock)
        self.on_motion: Callable[[MotionEvent], None] | None = None
        """Callback for the events of held commands."""
        self.on_command: Callable[[str, Mapping[str, Reading]], Mapping[str, Value]] | None = None
        """Callback that returns a command's reply values or raises an error; None for replies
        without values."""

    def open(self) -> AbstractAsyncContextManager["FakeRobot"]:
        """Count the call, and return a context in which the robot is connected."""
        return self._open()

    @asynccontextmanager
    async def _open(self) -> AsyncIterator["FakeRobot"]:
        self.opened += 1
        self.is_open = True
        self.hub = Hub(self.profile.driver.signals)
        self.link("live")
        try:
            yield self
        finally:
            self.is_open = False

    async def command(
        self,
        name: str,
        arguments: Mapping[str, Reading],
        *,
        confirmed_by: tuple[str, ...] = (),
        on_sent: Callable[[Payload], None] | None = None,
        unless: Callable[[], str] | None = None,
        on_goal: Callable[[str, bool], None] | None = None,
    ) -> Replied:
        """Record the command, report its sent frame, and return the test's reply."""
        if on_sent is not None:
            on_sent(self.payloads.get(name, name.encode()))
        self.confirmed_by.append(confirmed_by)
        self.commands.append((name, dict(arguments)))
        values = self.on_command(name, arguments) if self.on_command else {}
        return Replied(len(self.commands), name, values)

    def reconnect(self) -> None:
        """Count the call instead of reopening connections."""
        self.reconnects += 1

    def pull(self, sequence: str, what: Pull) -> None:
        """Record the request to pause, step, resume or end a sequence."""
        self.pulls.append((sequence, what))

    def latch(self, reason: str) -> None:
        """Record the reason for a latched stop."""
        self.latched.append(reason)

    def end_cancellations(self, actions: Collection[str]) -> None:
        """Record the actions whose cancellations end."""
        self.ended.append(tuple(actions))

    def set_reading(
        self, signal: str, value: Reading, *, alarm: Alarm = "", age_s: float = 0.0
    ) -> None:
        """Deliver a reading that is `age_s` seconds old."""
        self.hub.publish([Sample(signal, value, self.clock.now() - age_s, alarm)])

    def link(self, state: LinkState, detail: str = "", *, age_s: float = 0.0) -> None:
        """Set the only transport's state; the state began `age_s` seconds ago."""
        since_s = self.clock.now() - age_s
        self.hub.set_link(LinkStatus("wire", state, "tcp 127.0.0.1:6789", since_s, detail))

    def log(self, text: str) -> None:
        """Add an entry to the log."""
        self.hub.log(LogEntry(self.clock.now(), "info", "transport wire", text))
