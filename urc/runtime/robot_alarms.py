"""One robot's alarms, which are detected from its hub's samples, stored and announced.

Layer 4. Each sample includes its alarm, so one comparison shows whether the alarm has changed. Only
changes are processed. The object belongs to a robot, not to a session. Without a session, all
values are unknown, but the alarms persist.

While an alarm's expression `suppressed_when` is true, the alarm is suppressed by design. An
expression with an unknown or stale value counts as false. In the first seconds of a session, an
expression counts as true until all its values have arrived.
"""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Final, NamedTuple, Protocol

from urc.alarms.alarm_list import AlarmActor, AlarmList
from urc.alarms.record import AlarmEvent, AlarmRecord, condition_of
from urc.expressions import ExpressionError, Template
from urc.model.driver import Driver
from urc.model.values import NOTHING, AlarmAttributes, AlarmLimits, Reading, Sample, Signal
from urc.runtime.clock import Clock, PeriodicTimer
from urc.runtime.hub import Hub
from urc.runtime.signal_sources import sources_of

__all__ = ["CONNECTION", "AlarmMemory", "RobotAlarms"]

LOOK_S: Final = 1.0
"""Interval between checks for stale values and scheduled changes, in seconds."""
FIRST_VALUES_S: Final = 5.0
"""Time for which alarms wait for the first values of `suppressed_when` in a session, in seconds."""
LOST_S: Final = 30.0
"""How long a monitored robot's connection must stay lost to cause an alarm, in seconds."""
CONNECTION: Final = Signal(
    "connection",
    "string",
    title="Connection",
    limits=AlarmLimits(
        states=("lost",),
        attributes=(
            (
                "lost",
                AlarmAttributes(
                    cause="The robot is switched off or out of reach, so its values are unknown.",
                    action="Check the power and the network of the robot.",
                ),
            ),
        ),
    ),
)
"""The alarm that URC raises if a monitored robot's connection is lost. Without this alarm, a silent
robot would look healthy."""
_UNKNOWN: Final = ("?", "")
_CONNECTED: Final = ("live", "silent")

log = logging.getLogger(__name__)


class AlarmMemory(Protocol):
    """The store of all robots' alarms; see `urc.runtime.alarm_store.AlarmStore`."""

    def load(self, robot: str) -> list[AlarmRecord]:
        """Return a robot's stored records."""

    def save(
        self,
        robot: str,
        records: Mapping[str, AlarmRecord | None],
        events: Iterable[AlarmEvent],
    ) -> None:
        """Store changes without waiting."""

    def settle(self, timeout_s: float = ...) -> bool:
        """Wait until all changes are written; called in threads."""


class _Suppression(NamedTuple):
    signal: str
    condition: str
    expression: Template


class RobotAlarms:
    """The alarm list of one robot, with values from the hub of its current session."""

    def __init__(
        self,
        driver: Driver,
        clock: Clock,
        utc: Callable[[], float],
        *,
        key: str = "",
        memory: AlarmMemory | None = None,
        is_monitored: bool = False,
    ) -> None:
        """Continue with the stored alarms.

        Args:
            driver: the driver of the robot.
            clock: the clock of the readings.
            utc: source of UTC time, in seconds since 1970.
            key: name of the robot in the store.
            memory: the store; None means that nothing is stored.
            is_monitored: whether the robot stays connected for its alarms; if so, a lost connection
                also causes an alarm.
        """
        self._clock = clock
        self._utc = utc
        self.key = key
        """Name of the robot in the store."""
        self.memory = memory
        self.on_change: Callable[[], None] = _nothing
        """Callback after each change to the list, on the event loop."""
        self.on_events: Callable[[Sequence[AlarmEvent]], None] = _nothing_of
        """Callback for new events in the history, on the event loop."""
        self._hub: Hub | None = None
        self._names: Mapping[str, object] = NOTHING
        self._lost_s: dict[str, float] = {}
        """Time on `clock` at which each transport was lost; later connection attempts do not change
        it."""
        self._began_s = 0.0
        """Start time of the session on `clock`, in seconds."""
        self._timer: PeriodicTimer | None = None
        self._use(driver, is_monitored=is_monitored)
        records = memory.load(key) if memory is not None else []
        self.list = AlarmList(self._limits, records)
        """All non-normal alarms."""
        self.list.adopt(self._limits, utc())
        self._stored = 0
        self.edition = 0
        """Number of document versions so far; each version may change causes and actions."""
        self._finish()

    def _use(self, driver: Driver, *, is_monitored: bool) -> None:
        self.driver = driver
        declared = dict(driver.signals)
        self._watches_connection = is_monitored and CONNECTION.name not in declared
        if self._watches_connection and any(not one.limits.is_empty for one in declared.values()):
            declared[CONNECTION.name] = CONNECTION
        else:
            self._watches_connection = False
        self.signals: Mapping[str, Signal] = declared
        """The signals of the robot, plus `CONNECTION` for a monitored robot."""
        self._limits = _limits(declared)
        self._sources = sources_of(driver)
        self._seen: dict[str, tuple[str, str]] = dict.fromkeys(self._limits, _UNKNOWN)
        """Alarm and condition of each signal's last processed sample."""
        self._suppressions = tuple(_suppressions(self._limits))
        names = (one.expression.names for one in self._suppressions)
        inputs = frozenset(name for each in names for name in each) & driver.signals.keys()
        self._inputs: dict[str, Reading] = dict.fromkeys(inputs)
        """Newest value of each signal in the expressions."""

    def renew(self, driver: Driver, *, is_monitored: bool = False) -> None:
        """Use another version of the robot's document."""
        self._use(driver, is_monitored=is_monitored)
        self.list.adopt(self._limits, self._utc())
        self.edition += 1
        self._finish()

    @property
    def has_limits(self) -> bool:
        """Whether the robot's document declares alarms."""
        return bool(self._limits)

    # The session

    def start(self) -> None:
        """Start the regular checks for stale values and scheduled changes, on the event loop."""
        if self._timer is None and (self._limits or self.list.records):
            self._timer = PeriodicTimer(self._clock, LOOK_S, self._check)

    def stop(self) -> None:
        """Stop the regular checks for stale values and scheduled changes."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    @contextmanager
    def attending(self, hub: Hub, names: Mapping[str, object] = NOTHING) -> Iterator[None]:
        """Process the samples of a session while the context is open.

        Args:
            hub: the hub of the session.
            names: additional names in expressions, such as ``settings``.
        """
        if not self._limits:
            yield
            return
        self._hub, self._names = hub, names
        self._began_s = self._clock.now()
        self._lost_s = {}
        self._suppress()
        try:
            with hub.passed_to(self._judge_all):
                yield
        finally:
            self._hub = None
            self._inputs = dict.fromkeys(self._inputs)
            self._forget(self._limits)
            self._finish()

    def _judge_all(self, samples: Sequence[Sample]) -> None:
        """Update the suppression and then process the samples whose alarm has changed."""
        if self._inputs:
            self._update_inputs(samples)
        # Most samples need only this comparison, so it avoids calls and field names. Alarms from
        # limits have no condition here. Several alarm states can share one alarm, so their samples
        # are processed.
        seen = self._seen
        for sample in samples:
            before = seen.get(sample[0])
            if before is None or (
                sample[3] == before[0] and not before[1] and sample[1] is not None
            ):
                continue
            self._judge(sample)

    def _update_inputs(self, samples: Sequence[Sample]) -> None:
        has_changed = False
        for name, value, _, _ in samples:
            if name in self._inputs and self._inputs[name] != value:
                self._inputs[name] = value
                has_changed = True
        if has_changed:
            self._suppress()
            self._finish()

    def _judge(self, sample: Sample) -> None:
        name, value, _, alarm = sample
        if value is None:
            if self._seen[name] != _UNKNOWN:
                self._forget((name,))
                self._finish()
            return
        condition = ""
        if alarm in ("minor", "major"):
            condition = condition_of(alarm, value, self._limits[name])
        if self._seen[name] == (alarm, condition):
            return
        self._seen[name] = (alarm, condition)
        self.list.judge(name, alarm, value, self._utc())
        self._finish()

    def _forget(self, signals: Iterable[str]) -> None:
        signals = [*signals]
        self._seen |= dict.fromkeys(signals, _UNKNOWN)
        self.list.forget(signals, self._utc())

    def _suppress(self) -> None:
        if self._suppressions:
            found = frozenset(
                (one.signal, one.condition) for one in self._suppressions if self._is_true(one)
            )
            self.list.suppress(found, self._utc())

    def _is_true(self, suppression: _Suppression) -> bool:
        expression = suppression.expression
        old = [name for name in expression.names & self._inputs.keys() if self._is_old(name)]
        if old:
            is_new = self._clock.now() < self._began_s + FIRST_VALUES_S
            return is_new and all(self._is_awaited(name) for name in old)
        try:
            return bool(expression.evaluate({**self._names, **self._inputs}))
        except ExpressionError:
            return False  # an unnecessary alarm is less harmful than a hidden alarm

    def _is_old(self, name: str) -> bool:
        sample = self._hub.latest(name) if self._hub is not None else None
        if sample is None or sample.value is None or self._is_cut_off(name):
            return True
        return self._clock.now() - sample.time_s > self.signals[name].stale_after_s

    def _is_awaited(self, name: str) -> bool:
        return self._hub is not None and self._hub.latest(name) is None

    def _is_cut_off(self, name: str) -> bool:
        """Return whether all transports of a signal are disconnected; False without transports."""
        links = self._hub.links if self._hub is not None else {}
        states = [links[one].state for one in self._sources.get(name, ()) if one in links]
        return bool(states) and not any(state in _CONNECTED for state in states)

    def _check(self) -> float:
        """Process stale values and make all due changes."""
        if self._hub is not None:
            old = [
                name
                for name, record in self.list.records.items()
                if record.is_known
                and self._seen.get(name, _UNKNOWN) != _UNKNOWN
                and self._is_old(name)
            ]
            if old:
                self._forget(old)
            self._suppress()
            if self._watches_connection:
                self._judge_connection(self._hub)
        self.list.tick(self._utc())
        self._finish()
        return LOOK_S

    def _judge_connection(self, hub: Hub) -> None:
        """Check the connections; a connection lost for `LOST_S` causes an alarm."""
        # An idle connection is not lost: only commands open it.
        now, links = self._clock.now(), hub.links.values()
        self._lost_s = {
            one.transport: self._lost_s.get(one.transport, now)
            for one in links
            if one.state not in (*_CONNECTED, "idle")
        }
        is_lost = any(now - since >= LOST_S for since in self._lost_s.values())
        if is_lost:
            self.list.judge(CONNECTION.name, "minor", "lost", self._utc())
        elif not self._lost_s and links:
            self.list.judge(CONNECTION.name, "", "live", self._utc())

    # Operators

    def acknowledge(self, raised: Mapping[str, int], actor: AlarmActor) -> list[AlarmRecord]:
        """Acknowledge the alarms that the operator saw; see `AlarmList.acknowledge`."""
        done = self.list.acknowledge(raised, actor, self._utc())
        self._finish()
        return done

    def shelve(self, signals: Iterable[str], for_s: float, actor: AlarmActor) -> list[AlarmRecord]:
        """Shelve alarms for a number of seconds; return the newly shelved alarms."""
        now = self._utc()
        done = self.list.shelve(signals, now + for_s, actor, now)
        self._finish()
        return done

    def unshelve(self, signals: Iterable[str], actor: AlarmActor) -> list[AlarmRecord]:
        """Unshelve alarms; return the alarms that were shelved."""
        done = self.list.unshelve(signals, actor, self._utc())
        self._finish()
        return done

    # Inside

    def _finish(self) -> None:
        """Store all changes since the last call, and pass them to the callbacks."""
        if self.list.revision == self._stored:
            return
        changed = [name for name, at in self.list.changed.items() if at > self._stored and name]
        self._stored = self.list.revision
        events = self.list.take_events()
        if self.memory is not None:
            records = {name: self.list.records.get(name) for name in changed}
            self.memory.save(self.key, records, events)
        try:
            self.on_change()
            if events:
                self.on_events(events)
        except Exception:  # supervisor: a bug in a listener must not end the session
            log.exception("an alarm change was not announced")


def _limits(signals: Mapping[str, Signal]) -> dict[str, AlarmLimits]:
    return {name: one.limits for name, one in signals.items() if not one.limits.is_empty}


def _suppressions(limits: Mapping[str, AlarmLimits]) -> Iterator[_Suppression]:
    for signal, one in limits.items():
        for condition, attributes in one.attributes:
            if attributes.suppressed_when is not None:
                yield _Suppression(signal, condition, attributes.suppressed_when)


def _nothing() -> None:
    """Ignore a change."""


def _nothing_of(events: Sequence[AlarmEvent]) -> None:
    """Ignore events."""
