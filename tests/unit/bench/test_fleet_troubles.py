"""What counts as a stop, a fault and an excuse after a trouble in a fleet."""

from bench.rig.fleet_troubles import FleetTrial, judged_stop
from bench.rig.programs import Heard

MS = 1_000_000
STRUCK_NS = 1000 * MS


def lines(*rows: tuple[int, int]) -> list[Heard]:
    """Return a robot's log of rows: time in ms, and send time of the tick in ms or 0 for a stop."""
    return [Heard(time * MS, f"M {sent * 1000}") for time, sent in rows]


def test_the_stop_counts_from_the_last_tick_that_had_an_effect() -> None:
    heard = lines((900, 895), (1010, 1002), (1260, 0))
    assert judged_stop(heard, STRUCK_NS, is_guard=False) == (258.0, "", True)


def test_the_stop_of_a_guard_counts_from_the_trouble() -> None:
    heard = lines((900, 895), (1260, 0), (1270, 0))
    assert judged_stop(heard, STRUCK_NS, is_guard=True) == (260.0, "", True)


def test_motion_after_the_stop_is_a_fault() -> None:
    heard = lines((900, 895), (1260, 0), (4000, 1100))
    assert judged_stop(heard, STRUCK_NS, is_guard=False)[1] == (
        "the robot moved again after the stop"
    )


def test_a_missing_stop_is_a_fault_only_of_a_moving_robot() -> None:
    assert judged_stop(lines((900, 895)), STRUCK_NS, is_guard=False)[1:] == (
        "no stop came",
        True,
    )
    resting = lines((900, 895), (950, 0))
    assert judged_stop(resting, STRUCK_NS, is_guard=False)[1:] == ("", False)


def test_an_older_tick_after_a_newer_one_is_a_fault() -> None:
    heard = lines((900, 895), (950, 890), (1200, 0))
    assert judged_stop(heard, STRUCK_NS, is_guard=False)[1] == (
        "an older value arrived after a newer value"
    )


def trial(**changes: object) -> FleetTrial:
    """Return a good kill with changes."""
    good = FleetTrial(1, "kill", "router", 0.0, 260.0, 300.0, 200.0, 900.0, "", 0.0, 0.0)
    return good._replace(**changes)  # type: ignore[arg-type]


def test_a_late_stop_is_excused_only_by_a_delay_of_the_machine() -> None:
    assert trial().is_good
    assert not trial(stop_ms=340.0).is_excused
    assert trial(stop_ms=340.0, late_ms=45.0).is_excused
    assert not trial(stop_ms=340.0, late_ms=45.0, fault="no stop came").is_excused


def test_a_late_list_breaks_the_promise_after_a_kill_only() -> None:
    assert not trial(list_ms=1100.0).is_good
    assert not trial(list_ms=float("inf"), list_late_ms=500.0).is_excused
    assert trial(list_ms=1100.0, list_late_ms=150.0).is_excused
    assert trial(trouble="freeze", list_ms=2500.0).is_good


def test_a_robot_at_rest_says_nothing() -> None:
    assert trial(has_moved=False, stop_ms=float("inf")).is_excused
