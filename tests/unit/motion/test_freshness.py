"""Old inputs, and inputs played back, are refused without any clock but the server's."""

from hypothesis import given
from hypothesis import strategies as st

from urc.motion.freshness import OLDEST_S, ControlInput, DuplicateElimination, Freshness
from urc.motion.stall import StallWatch


def test_an_input_that_echoes_a_fresh_tick_is_taken_once() -> None:
    fresh = Freshness()
    echo = fresh.issue(10.0)
    assert fresh.refusal(ControlInput(epoch=3, number=1, echo=echo), 3, 10.1) == ""
    assert (
        fresh.refusal(ControlInput(3, 1, echo), 3, 10.1)
        == "the input is not newer than the previous input"
    )


def test_an_input_that_lay_in_a_buffer_is_refused() -> None:
    fresh = Freshness()
    echo = fresh.issue(10.0)
    assert (
        fresh.refusal(ControlInput(3, 1, echo), 3, 10.401)
        == "Link too slow: your input arrived 401 ms late"
    )


def test_an_input_of_another_lease_is_refused() -> None:
    fresh = Freshness()
    echo = fresh.issue(10.0)
    assert "lease 2" in fresh.refusal(ControlInput(2, 1, echo), 3, 10.0)


def test_no_input_from_before_a_release_counts_after_it() -> None:
    """A program may send a tick and the release from two threads, and swap them."""
    fresh = Freshness()
    echo = fresh.issue(10.0)
    fresh.release(7, "drive")
    for number in (6, 7):
        refusal = fresh.refusal(ControlInput(3, number, echo), 3, 10.0, "drive")
        assert refusal == "the input is not newer than the previous input"
    assert fresh.refusal(ControlInput(3, 8, echo), 3, 10.0, "drive") == ""
    fresh.release(2, "drive")
    assert fresh.refusal(ControlInput(3, 8, echo), 3, 10.0, "drive") != ""
    assert fresh.refusal(ControlInput(3, 1, echo), 3, 10.0, "turn") == ""


def test_a_release_without_a_number_refuses_no_later_input() -> None:
    fresh = Freshness()
    echo = fresh.issue(10.0)
    fresh.release(0)
    assert fresh.refusal(ControlInput(3, 1, echo), 3, 10.0) == ""
    fresh.release(4)
    assert fresh.refusal(ControlInput(3, 4, echo), 3, 10.0) != ""


def test_ticks_are_remembered_in_a_bounded_way() -> None:
    fresh = Freshness()
    first = fresh.issue(0.0)
    for number in range(1000):
        fresh.issue(number / 1000)
    assert (
        fresh.refusal(ControlInput(1, 1, first), 1, 0.0)
        == "the input does not echo a heartbeat of this server"
    )


def test_everything_recorded_and_played_back_is_refused() -> None:
    fresh, recorded = Freshness(), []
    for number in range(500):
        now = number * 0.05
        given = ControlInput(1, number, fresh.issue(now))
        assert fresh.refusal(given, 1, now) == ""
        recorded.append(given)
    assert all(fresh.refusal(given, epoch, 25.0) for given in recorded for epoch in (1, 2))


def test_a_line_is_stalled_when_bytes_stay_for_a_quarter_of_a_second() -> None:
    watch = StallWatch(0.25)
    assert not watch.saw(10, 1.0)
    assert watch.deadline == 1.25
    assert not watch.saw(10, 1.249)
    assert watch.saw(4, 1.25)


def test_a_line_that_was_clear_in_between_is_not_stalled() -> None:
    watch = StallWatch(0.25)
    watch.saw(10, 1.0)
    watch.saw(0, 1.1)
    assert not watch.saw(10, 1.3)
    assert watch.deadline == 1.55


@given(st.lists(st.booleans(), max_size=40), st.lists(st.booleans(), max_size=40), st.randoms())
def test_of_two_lines_in_order_each_number_counts_once_and_none_goes_back(
    first: list[bool], second: list[bool], dice: st.DataObject
) -> None:
    """However late one line is, and whatever of it was left out: what counts only grows."""
    lines = [[n for n, is_said in enumerate(one, 1) if is_said] for one in (first, second)]
    last = max((n for one in lines for n in one), default=0)
    order, taken = DuplicateElimination(), []
    while any(lines):
        number = dice.choice([one for one in lines if one]).pop(0)  # type: ignore[attr-defined]
        if order.accept("drive", number):
            taken.append(number)
    assert taken == sorted(set(taken))
    assert taken[-1:] == [last] * bool(last), "the newest always counts"


def test_what_is_said_of_one_control_is_nothing_to_another() -> None:
    order = DuplicateElimination()
    assert order.accept("drive", 5)
    assert order.accept("lift", 4)
    assert not order.accept("drive", 4)


def test_ticks_are_numbered_from_the_first_on() -> None:
    assert Freshness().issue(1.0) == 1
    fresh = Freshness(70)
    assert [fresh.issue(1.0), fresh.issue(1.1)] == [70, 71]


def test_control_without_a_name_is_one_control() -> None:
    fresh = Freshness()
    echo = fresh.issue(1.0)
    assert fresh.refusal(ControlInput(1, 1, echo), 1, 1.0) == ""
    assert (
        fresh.refusal(ControlInput(1, 1, echo), 1, 1.0, "")
        == "the input is not newer than the previous input"
    )


def test_number_below_0_is_newer_than_nothing() -> None:
    fresh = Freshness()
    echo = fresh.issue(1.0)
    assert (
        fresh.refusal(ControlInput(1, -1, echo), 1, 1.0)
        == "the input is not newer than the previous input"
    )
    assert fresh.refusal(ControlInput(1, 0, echo), 1, 1.0) == ""


def test_echo_of_a_tick_before_the_first_is_refused() -> None:
    fresh = Freshness()
    echo = fresh.issue(1.0)
    assert (
        fresh.refusal(ControlInput(1, 1, echo - 1), 1, 1.0)
        == "the input does not echo a heartbeat of this server"
    )


def test_input_is_taken_up_to_its_greatest_age_and_told_how_old_it_is_beyond() -> None:
    fresh = Freshness()
    echo = fresh.issue(0.0)
    assert fresh.refusal(ControlInput(1, 1, echo), 1, OLDEST_S) == ""
    assert (
        fresh.refusal(ControlInput(1, 2, echo), 1, 2.0)
        == "Link too slow: your input arrived 2000 ms late"
    )
