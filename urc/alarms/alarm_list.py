"""One robot's alarms: a state machine for each signal with limits, as in ISA-18.2.

Layer 3. Pure. The inputs are the alarm of each sample, suppressed conditions, lost values and
operator actions, each with its time. The outputs are the alarm records and the events of the alarm
history.

An alarm leaves the list only when its value is normal and it is acknowledged, or when a new
document no longer declares it. An alarm stays in the list if its value becomes unknown. A
chattering alarm (3 activations in a minute) ends only after 10 s of normal values, so it does not
flash or fill the history.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from urc.alarms.flood import FloodDetector
from urc.alarms.record import (
    AlarmEvent,
    AlarmEventKind,
    AlarmRecord,
    condition_of,
    is_easing,
    text_of_value,
)
from urc.model.values import Alarm, AlarmLimits, Reading

__all__ = [
    "CHATTER_S",
    "CHATTER_TIMES",
    "LONGEST_SHELF_S",
    "SETTLE_S",
    "AlarmActor",
    "AlarmList",
]

CHATTER_TIMES: Final = 3
CHATTER_S: Final = 60.0
SETTLE_S: Final = 10.0
"""How long values must be normal before a chattering alarm ends, in seconds."""
LONGEST_SHELF_S: Final = 86_400.0


class AlarmActor(NamedTuple):
    """The person, device or program that acknowledges or shelves an alarm."""

    name: str
    principal: str = ""


class AlarmList:
    """The alarms of one robot that are outside the normal state."""

    def __init__(
        self, limits: Mapping[str, AlarmLimits], records: Iterable[AlarmRecord] = ()
    ) -> None:
        """Create the list with the alarms that were stored before a restart.

        Args:
            limits: alarm limits, keyed by signal; `judge` accepts only these signals.
            records: the records from the last run; their values count as unknown until the next
                sample.
        """
        self.records: dict[str, AlarmRecord] = {
            one.signal: one._replace(is_known=False) for one in records
        }
        """Alarms outside the normal state, keyed by signal."""
        self.revision = 0
        """Number of changes to alarms and floods since the list was created."""
        self.changed: dict[str, int] = {}
        """Revision of the last change to each signal's alarm, including removed alarms."""
        self._limits = limits
        self._events: list[AlarmEvent] = []
        kept = self.records.values()
        self._number = max((one.number for one in kept), default=0)
        self._raised = max((one.raised for one in kept), default=0)
        self._flood = FloodDetector(max((one.group for one in kept), default=0))
        self._suppressed = frozenset(
            (one.signal, one.condition) for one in kept if one.is_suppressed
        )
        self._activations: dict[str, deque[float]] = {}
        self._settling: dict[str, float] = {}
        """Time at which each chattering alarm with a normal value will end, keyed by signal."""

    @property
    def is_flooded(self) -> bool:
        """Whether a flood is in progress: more alarms than one operator can handle."""
        return self._flood.is_flooded

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` next changes the list; None if no change is scheduled."""
        shelves = [one.shelved_until for one in self.records.values() if one.shelved_until]
        flood = self._flood.deadline
        more = [] if flood is None else [flood]
        return min((*shelves, *self._settling.values(), *more), default=None)

    def take_events(self) -> list[AlarmEvent]:
        """Remove and return the history events since the last call."""
        events, self._events = self._events, []
        return events

    # The robot

    def judge(self, signal: str, alarm: Alarm, value: Reading, now: float) -> None:
        """Update a signal's alarm from a sample; a sample without a value does not end an alarm."""
        if value is None:
            self.forget((signal,), now)
            return
        limits = self._limits[signal]
        condition = condition_of(alarm, value, limits)
        record = self.records.get(signal)
        if record is not None and not record.is_known:
            record = self._put(record._replace(is_known=True))
        if condition:
            self._activate(signal, condition, value, now)
            # Suppression that changed while the value was unknown takes effect only now.
            self._suppress(self.records[signal], now)
        elif record is not None and record.is_active:
            self._deactivate(record, value, now)

    def _activate(self, signal: str, condition: str, value: Reading, now: float) -> None:
        record = self.records.get(signal)
        priority = self._limits[signal].attributes_of(condition).priority
        if record is not None and record.is_active:
            # A chattering alarm that recurs before its end is counted but not raised again.
            if self._settling.pop(signal, None) is not None:
                record = self._put(record._replace(times=record.times + 1))
            if record.condition != condition:
                text = text_of_value(value)
                changed = record._replace(condition=condition, priority=priority, value=text)
                # Only a more severe condition needs another acknowledgement.
                if is_easing(record.condition, condition):
                    self._record(self._put(self._judged(changed)), "changed", now)
                else:
                    self._raise(changed, now)
            return
        self._flood_counts(now)  # first: this may begin a new burst, whose number the record stores
        self._activations.setdefault(signal, deque(maxlen=CHATTER_TIMES)).append(now)
        self._number += 1
        fresh = AlarmRecord(
            signal, condition, priority, self._number, self._flood.group, now, 0,
            value=text_of_value(value),
        )  # fmt: skip
        if record is not None:  # shelved, or returned without an acknowledgement
            fresh = fresh._replace(
                times=record.times + 1,
                shelved_until=record.shelved_until,
                shelved_by=record.shelved_by,
            )
        self._raise(fresh, now)

    def _raise(self, record: AlarmRecord, now: float) -> None:
        """Mark the alarm as unacknowledged, and record that it was raised."""
        # A time, so that numbers from an earlier run are never reused.
        self._raised = max(self._raised + 1, round(now * 1000))
        record = self._judged(
            record._replace(
                raised=self._raised, is_acknowledged=False, acknowledged_at=0.0, acknowledged_by=""
            )
        )
        self._record(self._put(record), "raised", now)

    def _deactivate(self, record: AlarmRecord, value: Reading, now: float) -> None:
        times = self._activations.get(record.signal, deque[float]())
        if len(times) == CHATTER_TIMES and 0 <= now - times[0] <= CHATTER_S:
            self._settling.setdefault(record.signal, now + SETTLE_S)
            return
        self._return(record._replace(value=text_of_value(value)), now)

    def _return(self, record: AlarmRecord, now: float) -> None:
        # No operator has to see or acknowledge a shelved or suppressed alarm.
        is_unseen = not record.is_annunciated
        returned = record._replace(
            is_active=False,
            is_suppressed=False,
            returned_at=now,
            is_acknowledged=record.is_acknowledged or is_unseen,
        )
        self._record(self._put(returned), "returned", now)

    def forget(self, signals: Iterable[str], now: float) -> None:
        """Mark lost or stale values of `signals` as unknown, but keep their alarms."""
        for signal in signals:
            record = self.records.get(signal)
            if record is not None and record.is_active and record.is_known:
                self._settling.pop(signal, None)
                self._record(self._put(record._replace(is_known=False)), "unknown", now)

    def suppress(self, suppressed: frozenset[tuple[str, str]], now: float) -> None:
        """Set which conditions of which signals are suppressed by design from now on.

        An alarm with an unknown value stays unchanged until the next sample of its signal.
        """
        if suppressed == self._suppressed:
            return
        self._suppressed = suppressed
        for record in [*self.records.values()]:
            if record.is_known:
                self._suppress(record, now)

    def _suppress(self, record: AlarmRecord, now: float) -> None:
        judged = self._judged(record)
        if judged.is_suppressed and not record.is_suppressed:
            self._record(self._put(judged), "suppressed", now)
        elif record.is_suppressed and record.is_active and not judged.is_suppressed:
            self._record(self._put(judged), "unsuppressed", now)
            self._raise(judged, now)

    def adopt(self, limits: Mapping[str, AlarmLimits], now: float) -> None:
        """Use a new document's limits, and remove alarms that the new document does not declare."""
        self._limits = limits
        self._settling.clear()
        for record in [*self.records.values()]:
            if not self._is_declared(record):
                gone = record._replace(is_active=False, is_acknowledged=True, shelved_until=0.0)
                self._record(self._put(gone), "removed", now)

    def _is_declared(self, record: AlarmRecord) -> bool:
        limits = self._limits.get(record.signal)
        if limits is None:
            return False
        is_limit = getattr(limits, record.condition, None) is not None
        return record.condition in limits.states or is_limit

    # Operators

    def acknowledge(
        self, raised: Mapping[str, int], actor: AlarmActor, now: float
    ) -> list[AlarmRecord]:
        """Acknowledge alarms; return the alarms that were unacknowledged before.

        Args:
            raised: the value of `raised` that the operator saw, keyed by signal. An alarm
                that has been raised again since then is not acknowledged.
            actor: the person, device or program that acknowledges the alarms.
            now: UTC time in seconds.
        """
        done = []
        for signal, number in raised.items():
            record = self.records.get(signal)
            if record is None or record.raised != number or record.is_acknowledged:
                continue
            if not record.is_annunciated:
                continue
            record = self._put(
                record._replace(
                    is_acknowledged=True, acknowledged_at=now, acknowledged_by=actor.name
                )
            )
            self._record(record, "acknowledged", now, actor)
            done.append(record)
        return done

    def shelve(
        self, signals: Iterable[str], until: float, actor: AlarmActor, now: float
    ) -> list[AlarmRecord]:
        """Shelve alarms until a time; return the newly shelved alarms.

        Shelving ends at most `LONGEST_SHELF_S` seconds after `now`.
        """
        until = min(until, now + LONGEST_SHELF_S)
        done = []
        for signal in signals:
            record = self.records.get(signal)
            if record is None or until <= now:
                continue
            # A shelved alarm that has returned to normal needs no acknowledgement.
            record = self._put(
                record._replace(
                    shelved_until=until,
                    shelved_by=actor.name,
                    is_acknowledged=record.is_acknowledged or not record.is_active,
                )
            )
            self._record(record, "shelved", now, actor)
            done.append(record)
        return done

    def unshelve(self, signals: Iterable[str], actor: AlarmActor, now: float) -> list[AlarmRecord]:
        """Unshelve alarms; return the alarms that were shelved."""
        found = [self.records.get(signal) for signal in signals]
        shelved = [one for one in found if one is not None and one.shelved_until]
        for record in shelved:
            self._unshelve(record, actor, now)
        return shelved

    def _unshelve(self, record: AlarmRecord, actor: AlarmActor | None, now: float) -> None:
        record = self._judged(record._replace(shelved_until=0.0, shelved_by=""))
        self._record(self._put(record), "unshelved", now, actor)
        if record.is_active:
            self._raise(record, now)

    # Time

    def tick(self, now: float) -> None:
        """End each shelving, chattering alarm and flood whose end time has passed."""
        for record in [*self.records.values()]:
            if 0 < record.shelved_until <= now:
                self._unshelve(record, None, now)
        for signal in [one for one, end in self._settling.items() if end <= now]:
            del self._settling[signal]
            self._return(self.records[signal], now)
        was_flooded = self._flood.is_flooded
        self._flood.tick(now)
        if was_flooded and not self._flood.is_flooded:
            self._revise("")
            self._events.append(AlarmEvent(now, "", "flood ended"))

    # Inside

    def _flood_counts(self, now: float) -> None:
        was_flooded = self._flood.is_flooded
        self._flood.tick(now)
        self._flood.count(now)
        if self._flood.is_flooded != was_flooded:
            self._revise("")
            kind: AlarmEventKind = "flood ended" if was_flooded else "flood began"
            self._events.append(AlarmEvent(now, "", kind))

    def _judged(self, record: AlarmRecord) -> AlarmRecord:
        """Return the record, marked as suppressed if its active condition is suppressed now."""
        pair = record.signal, record.condition
        return record._replace(is_suppressed=record.is_active and pair in self._suppressed)

    def _put(self, record: AlarmRecord) -> AlarmRecord:
        if record.state == "normal":
            self.records.pop(record.signal, None)
        else:
            self.records[record.signal] = record
        self._revise(record.signal)
        return record

    def _revise(self, signal: str) -> None:
        self.revision += 1
        self.changed[signal] = self.revision

    def _record(
        self,
        record: AlarmRecord,
        kind: AlarmEventKind,
        now: float,
        actor: AlarmActor | None = None,
    ) -> None:
        who = actor or AlarmActor("")
        self._events.append(
            AlarmEvent(
                now,
                record.signal,
                kind,
                record.condition,
                record.priority,
                record.value,
                record.state,
                who.name,
                who.principal,
                record.shelved_until,
                record.times,
            )
        )
