"""A held command moves while ticks come, and always stops."""

import itertools
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.model.payload import Count, FrameVariants, Numbered
from urc.motion.hold_to_run import (
    LATE_STOP_S,
    SHORTEST_LEASE_S,
    STOP_EVERY_S,
    STOP_FOR_S,
    HoldTerms,
    HoldToRun,
)

STOP = b"STOP"


def hold_to_run(**terms: Any) -> HoldToRun:
    made = HoldToRun(HoldTerms(STOP, period_s=0.05)._replace(**terms))
    made.arm()
    return made


def test_nothing_is_written_before_a_tick() -> None:
    idle = hold_to_run()
    assert idle.due(10.0, is_clear=True) is None
    assert idle.deadline is None


def test_a_tick_is_written_at_once() -> None:
    held = hold_to_run()
    assert held.tick(b"go 1", 1.0)
    assert held.due(1.0, is_clear=True) == b"go 1"
    assert held.due(1.0, is_clear=True) is None


def test_the_newest_value_wins_while_the_line_is_not_clear() -> None:
    held = hold_to_run()
    held.tick(b"go 1", 1.0)
    held.tick(b"go 2", 1.05)
    assert held.due(1.05, is_clear=False) is None
    held.tick(b"go 3", 1.1)
    assert held.due(1.1, is_clear=True) == b"go 3"
    assert held.due(1.1, is_clear=True) is None


def test_it_stops_when_the_lease_runs_out() -> None:
    held = hold_to_run(lease_s=0.25)
    held.tick(b"go", 1.0)
    held.due(1.0, is_clear=True)
    assert held.deadline == 1.25
    assert held.due(1.249, is_clear=True) is None
    assert held.due(1.25, is_clear=True) == STOP
    assert held.reason == "expired"


def test_a_stop_does_not_wait_for_a_clear_line_nor_for_the_rate() -> None:
    held = hold_to_run()
    for number in range(3):
        held.tick(b"go %d" % number, 1.0)
        held.due(1.0, is_clear=True)
    held.stop("released", 1.0)
    assert held.due(1.0, is_clear=False) == STOP


def test_after_the_stop_there_is_silence() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    held.stop("released", 1.1)
    assert held.due(1.1, is_clear=True) == STOP
    assert held.due(500.0, is_clear=True) is None
    assert held.deadline is None


def test_where_writes_are_lost_the_stop_is_repeated_for_half_a_second() -> None:
    held = hold_to_run(is_lossy=True)
    held.tick(b"go", 1.0)
    held.stop("released", 2.0)
    written = []
    now = 2.0
    while held.deadline is not None:
        now = max(now, held.deadline)
        if held.due(now, is_clear=True):
            written.append(round(now - 2.0, 3))
    assert written[0] == 0.0
    assert len(written) >= 10
    assert written[-1] <= 0.5


def repeats(held: HoldToRun, now: float) -> list[float]:
    """Write what is due until nothing is; return when, in seconds after `now`."""
    began, written = now, []
    while held.deadline is not None:
        now = max(now, held.deadline)
        if held.due(now, is_clear=True):
            written.append(round(now - began, 3))
    return written


def test_stop_of_a_restored_connection_is_repeated_for_robots_that_come_later() -> None:
    """Densely first, like any other stop, and then at most 0.2 s apart."""
    held = hold_to_run(is_lossy=True, restored_s=LATE_STOP_S)
    held.tick(b"go", 1.0)
    held.cut()
    held.restored(9.0)
    assert not held.tick(b"go", 9.0)
    written = repeats(held, 9.0)
    assert written[0] == 0.0
    assert LATE_STOP_S - 0.25 < written[-1] <= LATE_STOP_S
    assert len(written) <= 35, "more than the stops that are prepared for a control with counters"
    gaps = [later - one for one, later in itertools.pairwise(written)]
    assert max(gaps) <= 0.2 + 1e-6
    assert max(gaps[:9]) <= STOP_EVERY_S + 1e-6
    held.arm()
    held.tick(b"go", 20.0)
    held.stop("released", 20.0)
    assert repeats(held, 20.0)[-1] <= STOP_FOR_S


@pytest.mark.parametrize("terms", [{}, {"is_lossy": True}, {"restored_s": LATE_STOP_S}])
def test_stop_of_a_restored_connection_is_short_elsewhere(terms: dict[str, Any]) -> None:
    held = hold_to_run(**terms)
    held.tick(b"go", 1.0)
    held.cut()
    held.restored(9.0)
    assert repeats(held, 9.0)[-1] <= (STOP_FOR_S if "is_lossy" in terms else 0.0)


def test_late_repeats_end_for_new_motion_and_before_a_close() -> None:
    """The operator drives on at once; a connection that is closed waits for no late robot."""
    held = hold_to_run(is_lossy=True, restored_s=LATE_STOP_S)
    held.tick(b"go", 1.0)
    held.cut()
    held.restored(9.0)
    assert held.due(9.0, is_clear=True) == STOP
    held.arm()
    assert held.tick(b"go again", 9.1)
    assert held.due(9.1, is_clear=True) == b"go again"
    held.cut()
    held.restored(10.0)
    held.shorten(10.0)
    assert repeats(held, 10.0)[-1] <= STOP_FOR_S


def test_ticks_after_the_lease_do_not_resume_the_motion() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    held.due(1.0, is_clear=True)
    assert not held.tick(b"go", 1.3)
    assert held.due(1.3, is_clear=True) == STOP
    assert not held.tick(b"go", 1.35)
    assert held.due(1.35, is_clear=True) is None
    held.arm()
    assert held.tick(b"go", 1.4)


def test_after_a_release_the_next_gesture_moves_at_once() -> None:
    held = hold_to_run(is_lossy=True)
    held.tick(b"go", 1.0)
    held.stop("released", 1.1)
    assert held.due(1.1, is_clear=True) == STOP
    assert held.tick(b"go again", 1.12)
    assert held.due(1.15, is_clear=True) == b"go again"


def test_a_cut_line_gets_the_stop_first_and_nothing_old() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    held.cut()
    assert held.due(1.1, is_clear=True) is None
    assert not held.tick(b"go", 1.2)
    held.restored(9.0)
    assert held.due(9.0, is_clear=True) == STOP
    assert held.due(9.0, is_clear=True) is None


def test_a_control_whose_line_is_cut_is_idle_and_waits_for_no_time() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    held.cut()
    assert held.state == "idle"
    assert held.deadline is None


def test_a_line_that_is_cut_while_idle_gets_nothing() -> None:
    held = hold_to_run()
    held.cut()
    held.restored(9.0)
    assert held.due(9.0, is_clear=True) is None


def test_a_release_of_what_does_not_move_is_silent() -> None:
    idle = hold_to_run()
    idle.stop("released", 5.0)
    assert idle.due(5.0, is_clear=True) is None


def test_stop_is_not_refused_when_nothing_moves() -> None:
    idle = hold_to_run()
    idle.stop("stopped", 5.0)
    assert idle.due(5.0, is_clear=False) == STOP


@pytest.mark.parametrize("lease_s", [0.0, 0.05, 1.01, float("nan"), float("inf")])
def test_there_is_no_motion_without_a_lease(lease_s: float) -> None:
    with pytest.raises(ValueError, match="lease"):
        HoldToRun(HoldTerms(STOP, 0.05, lease_s=lease_s))


_STEPS = st.lists(
    st.tuples(
        st.sampled_from(["tick", "release", "stop", "cut", "restore", "arm", "look", "block"]),
        st.floats(0.0, 0.4),
    ),
    max_size=60,
)


@settings(max_examples=examples(150))
@given(steps=_STEPS, is_lossy=st.booleans())
def test_whatever_happens_the_last_thing_written_is_the_stop(
    steps: list[tuple[str, float]], *, is_lossy: bool
) -> None:
    held, now = hold_to_run(is_lossy=is_lossy), 0.0
    written: list[tuple[float, bytes]] = []
    ticked_at = float("-inf")

    def look(*, is_clear: bool) -> None:
        data = held.due(now, is_clear=is_clear)
        if data is not None:
            assert isinstance(data, bytes)
            written.append((now, data))

    is_up = True
    for verb, wait_s in steps:
        if is_up and held.deadline is not None and held.deadline <= now + wait_s:
            now = max(now, held.deadline)
            look(is_clear=True)
        now += wait_s
        if verb == "tick" and held.tick(b"go", now):
            ticked_at = now
        elif verb == "release":
            held.stop("released", now)
        elif verb == "stop":
            held.stop("stopped", now)
        elif verb == "arm":
            held.arm()
        elif verb == "cut":
            held.cut()
            is_up = False
        elif verb == "restore":
            held.restored(now)
            is_up = True
        if is_up:
            look(is_clear=verb != "block")
        if written and written[-1] == (now, b"go"):
            assert now - ticked_at <= held.terms.lease_s, "motion older than its lease was written"
    if not is_up:
        held.restored(now)
    for _ in range(40):
        if held.deadline is None:
            break
        now = max(now, held.deadline)
        look(is_clear=True)
    assert held.state == "idle"
    if any(data == b"go" for _, data in written):
        assert written[-1][1] == STOP


def test_a_stop_that_may_be_lost_with_the_line_is_owed() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    held.stop("released", 1.1)
    assert held.due(1.1, is_clear=True) == STOP
    held.cut(is_doubtful=True)
    assert held.owes_stop
    held.restored(2.0)
    assert held.due(2.0, is_clear=False) == STOP


def test_other_terms_keep_what_is_owed() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    held.cut()
    held.renew(HoldTerms(b"HALT", period_s=0.1))
    held.arm()
    assert not held.tick(b"go", 1.5), "the stop comes first"
    held.restored(2.0)
    assert held.due(2.0, is_clear=True) == b"HALT"


def test_terms_without_an_end_are_refused_when_renewed() -> None:
    with pytest.raises(ValueError, match="lease"):
        hold_to_run().renew(HoldTerms(STOP, period_s=0.05, lease_s=5.0))


def test_each_stop_is_to_be_told_once() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    assert held.is_told
    held.stop("released", 1.1)
    assert not held.is_told


def test_it_must_stop_when_its_lease_is_over() -> None:
    held = hold_to_run(lease_s=0.25)
    assert not held.must_stop(0.0)
    held.tick(b"go", 1.0)
    assert held.is_waiting
    assert not held.must_stop(1.2)
    assert held.must_stop(1.25)


def test_other_terms_with_the_same_rate_do_not_let_it_go_faster() -> None:
    """A gesture right after another one is one more write of the same control."""
    held = hold_to_run()
    for _ in range(2):
        held.tick(b"go", 1.0)
        held.due(1.0, is_clear=True)
    held.renew(HoldTerms(b"HALT", period_s=0.05))
    held.tick(b"go on", 1.01)
    assert held.due(1.01, is_clear=True) is None
    assert held.due(1.06, is_clear=True) == b"go on"


def test_other_rate_counts_from_now_on() -> None:
    held = hold_to_run()
    for _ in range(2):
        held.tick(b"go", 1.0)
        held.due(1.0, is_clear=True)
    held.renew(HoldTerms(STOP, period_s=0.2))
    written = []
    for step in range(100):
        now = 1.0 + step / 100
        held.tick(b"go on", now)
        written += [now] if held.due(now, is_clear=True) else []
    assert 5 <= len(written) <= 6


def test_a_value_that_is_forgotten_is_not_written_and_the_lease_goes_on() -> None:
    held = hold_to_run()
    held.tick(b"go", 1.0)
    held.forget()
    assert not held.is_waiting
    assert held.due(1.0, is_clear=True) is None
    assert held.deadline == 1.25
    assert held.due(1.3, is_clear=False) == STOP


def test_stop_without_a_number_takes_the_place_of_all_that_had_one() -> None:
    plain = HoldTerms(b"halt", period_s=0.05)
    numbered = Numbered(b"7 halt", Count({"n": 6}, {"n": 7}))
    counted = plain.stopped_by(FrameVariants((numbered,)))
    assert (counted.stop, counted.stops) == (b"7 halt", (numbered,))
    assert counted.stopped_by(b"halt") == plain


def test_it_is_not_armed_at_first_and_has_never_stopped() -> None:
    held = HoldToRun(HoldTerms(STOP, period_s=0.05, lease_s=SHORTEST_LEASE_S))
    assert not held.tick(b"go", 1.0)
    assert held.reason is None


def test_a_tick_just_when_the_lease_is_over_comes_too_late_and_is_told_why() -> None:
    held = hold_to_run(lease_s=0.25)
    held.tick(b"go", 1.0)
    assert not held.tick(b"go", 1.25)
    assert (held.state, held.reason) == ("stopping", "expired")


def test_the_last_repeat_of_a_stop_comes_when_its_time_is_over() -> None:
    held = hold_to_run(is_lossy=True)
    held.tick(b"go", 0.0)
    held.stop("released", 0.0)
    assert held.due(STOP_FOR_S - STOP_EVERY_S, is_clear=True) == STOP
    assert held.due(STOP_FOR_S, is_clear=True) == STOP
    assert held.state == "idle"


def test_a_cut_disarms_also_what_did_not_move() -> None:
    held = hold_to_run()
    held.cut()
    held.restored(2.0)
    assert not held.tick(b"go", 2.0)


def test_the_end_of_a_step_is_told_once_also_on_a_line_that_may_lose_it() -> None:
    """There is nothing to write, so nothing to repeat."""
    held = hold_to_run(stop=b"", is_lossy=True)
    held.tick(b"step", 1.0)
    held.stop("released", 1.1)
    assert held.due(1.1, is_clear=True) == b""
    assert held.state == "idle"
