"""Any course of values, losses, people and restarts: no alarm is lost or acknowledged by itself."""

from collections import Counter
from collections.abc import Iterable

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from tests.effort import examples
from urc.alarms.alarm_list import AlarmActor, AlarmList
from urc.alarms.record import AlarmEvent, AlarmRecord
from urc.model.values import Alarm, AlarmLimits

LIMITS = {
    "volts": AlarmLimits(lolo=1, low=2, high=8, hihi=9),
    "heat": AlarmLimits(high=5),
    "bump": AlarmLimits(states=("true",)),
}
ADA = AlarmActor("Ada", "p1")
SIGNALS = st.sampled_from(sorted(LIMITS))
ENDS = ("returned", "acknowledged", "unshelved", "removed")


def alarm_of(signal: str, value: int) -> tuple[Alarm, object]:
    """Return the alarm of a value, and the value, as the engine judges it."""
    if signal == "bump":
        return ("minor" if value % 2 else ""), bool(value % 2)
    limits = LIMITS[signal]
    for level, is_past in (
        ("lolo", limits.lolo is not None and value <= limits.lolo),
        ("hihi", limits.hihi is not None and value >= limits.hihi),
        ("low", limits.low is not None and value <= limits.low),
        ("high", limits.high is not None and value >= limits.high),
    ):
        if is_past:
            return level, value  # type: ignore[return-value]
    return "", value


class AlarmCourse(RuleBasedStateMachine):
    """One robot, one operator, and a server that may be killed."""

    @initialize()
    def begin(self) -> None:
        self.now = 1_000.0
        self.alarms = AlarmList(LIMITS)
        self.abnormal: dict[str, bool] = dict.fromkeys(LIMITS, False)
        self.activations: Counter[str] = Counter()
        self.over: Counter[str] = Counter()
        self.unseen: set[str] = set()
        """Signals whose alarm was raised after its last acknowledgement."""
        self.last: dict[str, str] = {}

    def drain(self) -> list[AlarmEvent]:
        events = self.alarms.take_events()
        for one in events:
            if one.kind == "raised":
                self.unseen.add(one.signal)
            if one.kind == "acknowledged":
                self.unseen.discard(one.signal)
            if one.kind in ENDS and one.state == "normal":
                self.over[one.signal] += one.times
                self.unseen.discard(one.signal)
        return events

    @rule(signal=SIGNALS, value=st.integers(0, 10), later=st.floats(0, 90))
    def value_comes(self, signal: str, value: int, later: float) -> None:
        self.now += later
        self.alarms.tick(self.now)
        self.drain()
        alarm, reading = alarm_of(signal, value)
        if alarm and not self.abnormal[signal]:
            self.activations[signal] += 1
        self.abnormal[signal] = bool(alarm)
        self.last[signal] = alarm if alarm != "minor" else "true"
        before = self.alarms.records.get(signal)
        self.alarms.judge(signal, alarm, reading, self.now)  # type: ignore[arg-type]
        self.drain()
        record = self.alarms.records.get(signal)
        if before is not None and before.state in ("unacknowledged", "returned"):
            assert record is not None
            assert record.state in ("unacknowledged", "returned", "suppressed")
        if alarm:
            assert record is not None
            assert record.is_active
            assert record.is_known
            assert record.condition == self.last[signal]

    @rule(later=st.floats(0, 700))
    def time_passes(self, later: float) -> None:
        end = self.now + later
        while (due := self.alarms.deadline) is not None and due <= end:
            assert due > self.now - 1e-6, "nothing that is due is left behind"
            self.now = max(self.now, due)
            self.alarms.tick(self.now)
            assert self.alarms.deadline is None or self.alarms.deadline > due - 1e-6
            self.drain()
        self.now = end

    @rule(signals=st.sets(SIGNALS, min_size=1))
    def values_are_lost(self, signals: Iterable[str]) -> None:
        before = dict(self.alarms.records)
        self.alarms.forget(signals, self.now)
        self.drain()
        assert self.alarms.records.keys() == before.keys(), "no alarm vanishes with its link"
        for signal in signals:
            record = self.alarms.records.get(signal)
            self.abnormal[signal] = record is not None and record.is_active
            self.last.pop(signal, None)

    @rule(signals=st.sets(SIGNALS, min_size=1), is_late=st.booleans())
    def operator_acknowledges(self, signals: Iterable[str], is_late: bool) -> None:
        seen = {
            one: self.alarms.records[one].raised - is_late
            for one in signals
            if one in self.alarms.records
        }
        done = self.alarms.acknowledge(seen, ADA, self.now)
        assert not (is_late and done)
        self.drain()

    @rule(signal=SIGNALS, for_s=st.floats(1, 900))
    def operator_shelves(self, signal: str, for_s: float) -> None:
        before = self.alarms.records.get(signal)
        if before is not None and not before.is_active:
            self.unseen.discard(signal)  # returned to normal: the shelf takes it off the list
        self.alarms.shelve([signal], self.now + for_s, ADA, self.now)
        self.drain()

    @rule(signal=SIGNALS)
    def operator_unshelves(self, signal: str) -> None:
        self.alarms.unshelve([signal], ADA, self.now)
        self.drain()

    @rule(pairs=st.sets(st.sampled_from([("volts", "low"), ("volts", "lolo"), ("bump", "true")])))
    def design_suppresses(self, pairs: set[tuple[str, str]]) -> None:
        self.alarms.suppress(frozenset(pairs), self.now)
        self.drain()

    @rule()
    def server_is_killed(self) -> None:
        kept = [AlarmRecord._make(tuple(one)) for one in self.alarms.records.values()]
        states = {one.signal: one.state for one in kept}
        self.alarms = AlarmList(LIMITS, kept)
        assert {one.signal: one.state for one in self.alarms.records.values()} == states
        self.last.clear()
        for signal in LIMITS:
            record = self.alarms.records.get(signal)
            self.abnormal[signal] = record is not None and record.is_active

    @invariant()
    def records_are_never_normal(self) -> None:
        for record in self.alarms.records.values():
            assert record.state != "normal"

    @invariant()
    def nothing_is_acknowledged_by_itself(self) -> None:
        for record in self.alarms.records.values():
            if record.state == "acknowledged":
                assert record.signal not in self.unseen

    @invariant()
    def every_activation_is_counted(self) -> None:
        for signal in LIMITS:
            record = self.alarms.records.get(signal)
            there = record.times if record is not None else 0
            assert self.over[signal] + there == self.activations[signal]

    @invariant()
    def every_change_has_a_revision(self) -> None:
        assert {*self.alarms.records} <= {*self.alarms.changed} | {
            one.signal for one in self.alarms.records.values() if not one.is_known
        }


AlarmCourse.TestCase.settings = settings(
    max_examples=examples(600), stateful_step_count=40, deadline=None
)
TestAnyCourse = AlarmCourse.TestCase
