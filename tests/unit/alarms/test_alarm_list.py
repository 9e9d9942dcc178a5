"""The alarms of one robot: what operators see, and what they can do about it."""

from urc.alarms.alarm_list import LONGEST_SHELF_S, SETTLE_S, AlarmActor, AlarmList
from urc.model.values import AlarmAttributes, AlarmLimits

ADA, BOB = AlarmActor("Ada", "p1"), AlarmActor("Bob", "p2")
LIMITS = {
    "battery": AlarmLimits(
        lolo=10, low=20, attributes=(("low", AlarmAttributes("low", action="Dock.")),)
    ),
    "heat": AlarmLimits(high=70, hihi=80),
    "mode": AlarmLimits(
        states=("stopped", "reduced"), attributes=(("stopped", AlarmAttributes("high")),)
    ),
}


def made() -> AlarmList:
    return AlarmList(LIMITS)


def kinds(alarms: AlarmList) -> list[str]:
    """Return signal and kind of each event since the last call."""
    return [f"{one.signal} {one.kind}".strip() for one in alarms.take_events()]


def state(alarms: AlarmList, signal: str) -> str:
    return alarms.records[signal].state


def is_known(alarms: AlarmList, signal: str) -> bool:
    return alarms.records[signal].is_known


def is_flooded(alarms: AlarmList) -> bool:
    return alarms.is_flooded


def acknowledge(alarms: AlarmList, *signals: str, now: float = 50.0) -> list[str]:
    """Acknowledge what is seen now; return the signals that were acknowledged."""
    seen = {one: alarms.records[one].raised for one in signals if one in alarms.records}
    return [one.signal for one in alarms.acknowledge(seen, ADA, now)]


def test_an_alarm_goes_through_its_four_states() -> None:
    """Active, acknowledged, returned: gone; or returned first, and gone once acknowledged."""
    alarms = made()
    alarms.judge("battery", "low", 15, 100)
    first = alarms.records["battery"]
    assert (first.state, first.condition, first.priority) == ("unacknowledged", "low", "low")
    assert (first.value, first.began_at, first.number) == ("15", 100, 1)
    assert acknowledge(alarms, "battery") == ["battery"]
    assert state(alarms, "battery") == "acknowledged"
    assert alarms.records["battery"].acknowledged_by == "Ada"
    alarms.judge("battery", "", 60, 200)
    assert alarms.records == {}
    alarms.judge("battery", "low", 15, 300)
    alarms.judge("battery", "", 60, 400)
    assert state(alarms, "battery") == "returned"
    assert alarms.records["battery"].returned_at == 400
    assert acknowledge(alarms, "battery") == ["battery"]
    assert alarms.records == {}
    assert kinds(alarms) == [
        "battery raised", "battery acknowledged", "battery returned",
        "battery raised", "battery returned", "battery acknowledged",
    ]  # fmt: skip


def test_a_worse_condition_asks_again_and_a_lesser_one_does_not() -> None:
    alarms = made()
    alarms.judge("battery", "low", 15, 100)
    acknowledge(alarms, "battery")
    alarms.judge("battery", "lolo", 9, 110)
    worse = alarms.records["battery"]
    assert (worse.state, worse.condition, worse.priority) == ("unacknowledged", "lolo", "high")
    assert (worse.number, worse.began_at) == (1, 100), "it is still the first one out"
    acknowledge(alarms, "battery")
    alarms.judge("battery", "low", 12, 120)
    assert state(alarms, "battery") == "acknowledged"
    assert kinds(alarms)[-1] == "battery changed"


def test_another_state_asks_again() -> None:
    """A second cause is not the one that was acknowledged."""
    alarms = made()
    alarms.judge("mode", "minor", "reduced", 100)
    acknowledge(alarms, "mode")
    alarms.judge("mode", "major", "stopped", 101)
    assert (alarms.records["mode"].condition, alarms.records["mode"].priority) == (
        "stopped", "high",
    )  # fmt: skip
    assert state(alarms, "mode") == "unacknowledged"


def test_only_what_was_seen_is_acknowledged() -> None:
    """The alarm became worse while the finger went down."""
    alarms = made()
    alarms.judge("battery", "low", 15, 100)
    seen = alarms.records["battery"].raised
    alarms.judge("battery", "lolo", 9, 101)
    assert alarms.acknowledge({"battery": seen}, ADA, 102) == []
    assert alarms.acknowledge({"heat": 7}, ADA, 102) == []
    assert state(alarms, "battery") == "unacknowledged"


def test_first_out_is_the_order_of_beginning() -> None:
    alarms = made()
    for at, signal in enumerate(("heat", "battery", "mode")):
        alarm = {"heat": "hihi", "battery": "low", "mode": "major"}[signal]
        alarms.judge(signal, alarm, "stopped" if signal == "mode" else 0, 100 + at)  # type: ignore[arg-type]
    found = sorted(alarms.records.values(), key=lambda one: one.number)
    assert [one.signal for one in found] == ["heat", "battery", "mode"]
    assert len({one.group for one in found}) == 1
    alarms.judge("battery", "", 60, 200)
    alarms.judge("battery", "low", 15, 300)
    assert alarms.records["battery"].number == 4
    assert alarms.records["battery"].group == 2


def test_a_shelved_alarm_is_quiet_until_its_end_and_asks_again() -> None:
    alarms = made()
    alarms.judge("heat", "high", 75, 100)
    (shelved,) = alarms.shelve(["heat", "battery"], 160, BOB, 101)
    assert (shelved.state, shelved.shelved_by) == ("shelved", "Bob")
    assert not shelved.is_annunciated
    alarms.judge("heat", "", 60, 110)
    alarms.judge("heat", "high", 75, 120)
    assert state(alarms, "heat") == "shelved"
    assert alarms.deadline == 160
    alarms.tick(159)
    assert state(alarms, "heat") == "shelved"
    alarms.tick(160)
    assert state(alarms, "heat") == "unacknowledged"
    assert kinds(alarms) == [
        "heat raised", "heat shelved", "heat returned", "heat raised", "heat unshelved",
        "heat raised",
    ]  # fmt: skip


def test_a_shelf_that_ends_with_a_normal_value_leaves_nothing() -> None:
    alarms = made()
    alarms.judge("heat", "high", 75, 100)
    alarms.shelve(["heat"], 160, BOB, 101)
    alarms.judge("heat", "", 60, 110)
    assert state(alarms, "heat") == "shelved"
    assert [one.signal for one in alarms.unshelve(["heat", "mode"], ADA, 120)] == ["heat"]
    assert alarms.records == {}


def test_no_shelf_is_endless() -> None:
    alarms = made()
    alarms.judge("heat", "high", 75, 100)
    (shelved,) = alarms.shelve(["heat"], 1e12, BOB, 101)
    assert shelved.shelved_until == 101 + LONGEST_SHELF_S
    assert alarms.shelve(["heat"], 100, BOB, 101) == [], "an end in the past"


def test_an_alarm_that_is_suppressed_by_design_asks_when_the_suppression_ends() -> None:
    alarms = made()
    alarms.suppress(frozenset({("battery", "low")}), 90)
    alarms.judge("battery", "low", 15, 100)
    assert state(alarms, "battery") == "suppressed"
    assert acknowledge(alarms, "battery") == []
    alarms.judge("battery", "lolo", 9, 110)
    assert state(alarms, "battery") == "unacknowledged", "only 'low' is suppressed"
    alarms.judge("battery", "low", 12, 120)
    assert state(alarms, "battery") == "suppressed"
    alarms.suppress(frozenset(), 130)
    assert state(alarms, "battery") == "unacknowledged"
    alarms.suppress(frozenset({("battery", "low")}), 140)
    alarms.judge("battery", "", 60, 150)
    assert alarms.records == {}


def test_a_lost_value_does_not_end_a_suppression() -> None:
    """The robot stands on its dock, and the last page closes; or the server restarts."""
    alarms = made()
    alarms.suppress(frozenset({("battery", "low")}), 90)
    alarms.judge("battery", "low", 15, 100)
    alarms.forget(["battery"], 110)
    alarms.suppress(frozenset(), 120)
    assert state(alarms, "battery") == "suppressed"
    later = AlarmList(LIMITS, alarms.records.values())
    later.suppress(frozenset({("battery", "low")}), 200)
    later.judge("battery", "low", 15, 201)
    assert state(later, "battery") == "suppressed"
    alarms.judge("battery", "low", 15, 202)
    assert state(alarms, "battery") == "unacknowledged"
    assert kinds(alarms)[-2:] == ["battery unsuppressed", "battery raised"]


def test_an_alarm_of_a_lost_value_stays() -> None:
    """It is known again with the next value, and only a normal value ends it."""
    alarms = made()
    alarms.judge("battery", "low", 15, 100)
    alarms.forget(["battery", "heat"], 110)
    assert state(alarms, "battery") == "unacknowledged"
    assert not is_known(alarms, "battery")
    assert acknowledge(alarms, "battery") == ["battery"]
    assert state(alarms, "battery") == "acknowledged"
    alarms.judge("battery", "low", 15, 120)
    assert is_known(alarms, "battery")
    alarms.judge("battery", "", None, 130)
    assert not is_known(alarms, "battery"), "“not available” is no normal value"
    alarms.judge("battery", "", 50, 140)
    assert alarms.records == {}
    assert kinds(alarms) == [
        "battery raised", "battery unknown", "battery acknowledged", "battery unknown",
        "battery returned",
    ]  # fmt: skip


def test_a_restart_forgets_neither_alarm_nor_acknowledgement() -> None:
    alarms = made()
    alarms.judge("battery", "low", 15, 100)
    alarms.judge("heat", "high", 75, 101)
    alarms.judge("mode", "major", "stopped", 102)
    acknowledge(alarms, "battery")
    alarms.shelve(["heat"], 500, BOB, 103)
    later = AlarmList(LIMITS, alarms.records.values())
    assert {one.signal: one.state for one in later.records.values()} == {
        "battery": "acknowledged", "heat": "shelved", "mode": "unacknowledged",
    }  # fmt: skip
    assert not any(one.is_known for one in later.records.values())
    later.judge("battery", "low", 14, 200)
    assert state(later, "battery") == "acknowledged"
    assert later.records["battery"].acknowledged_by == "Ada"
    later.tick(500)
    assert state(later, "heat") == "unacknowledged"


def test_a_number_of_an_earlier_run_acknowledges_nothing() -> None:
    """A page that slept through a restart has seen another alarm."""
    alarms = made()
    alarms.judge("battery", "low", 15, 100)
    seen = alarms.records["battery"].raised
    later = AlarmList(LIMITS)
    later.judge("battery", "low", 15, 200)
    assert later.acknowledge({"battery": seen}, ADA, 201) == []


def test_a_chattering_alarm_is_one_alarm() -> None:
    """The third activation within a minute holds until the value stays normal."""
    alarms = made()
    for at in range(100, 130):
        alarms.judge("heat", "high" if at % 2 == 0 else "", 75 if at % 2 == 0 else 60, at)
    record = alarms.records["heat"]
    assert (record.state, record.times) == ("unacknowledged", 15)
    assert acknowledge(alarms, "heat") == ["heat"]
    assert alarms.deadline == 129 + SETTLE_S
    alarms.tick(138.9)
    assert state(alarms, "heat") == "acknowledged"
    alarms.tick(139)
    assert alarms.records == {}
    told = alarms.take_events()
    assert [one.kind for one in told] == [
        "raised", "returned", "raised", "returned", "raised", "acknowledged", "returned",
    ]  # fmt: skip
    assert told[-1].times == 15, "none is lost"


def test_a_flood_begins_and_ends_as_in_the_standard() -> None:
    limits = {f"s{number}": AlarmLimits(high=1) for number in range(20)}
    alarms = AlarmList(limits)
    for number in range(10):
        alarms.judge(f"s{number}", "high", 2, 100 + 30 * number)
    assert not is_flooded(alarms)
    alarms.judge("s10", "high", 2, 400)
    assert is_flooded(alarms)
    assert [one.kind for one in alarms.take_events()].count("flood began") == 1
    assert alarms.deadline == 280 + 600
    alarms.tick(879)
    assert is_flooded(alarms)
    alarms.tick(880)
    assert not is_flooded(alarms)
    assert kinds(alarms) == ["flood ended"]
    assert len(alarms.records) == 11


def test_a_new_document_removes_alarms_that_it_lacks() -> None:
    alarms = made()
    alarms.judge("battery", "lolo", 5, 100)
    alarms.judge("heat", "high", 75, 101)
    alarms.judge("mode", "major", "stopped", 102)
    alarms.shelve(["heat"], 500, BOB, 103)
    alarms.take_events()
    alarms.adopt({"battery": LIMITS["battery"], "mode": AlarmLimits(states=("lost",))}, 110)
    assert [*alarms.records] == ["battery"]
    assert kinds(alarms) == ["heat removed", "mode removed"]


def test_changes_are_numbered_for_pages_that_know_the_rest() -> None:
    alarms = made()
    alarms.judge("battery", "low", 15, 100)
    seen = alarms.revision
    alarms.judge("heat", "high", 75, 101)
    alarms.judge("battery", "", 50, 102)
    acknowledge(alarms, "battery")
    changed = {signal for signal, at in alarms.changed.items() if at > seen}
    assert changed == {"heat", "battery"}
    assert "battery" not in alarms.records
