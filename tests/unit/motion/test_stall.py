"""A line that does not take what is written is noticed by the age of its oldest unsent byte."""

from urc.motion.stall import StallWatch


def test_nothing_unsent_is_no_stall() -> None:
    watch = StallWatch()
    assert not watch.saw(0, 1.0)
    assert watch.deadline is None
    assert watch.age_s(9.0) == 0.0


def test_bytes_that_stay_are_a_stall() -> None:
    watch = StallWatch(0.25)
    assert not watch.saw(10, 1.0)
    assert watch.deadline == 1.25
    assert not watch.saw(10, 1.2)
    assert watch.saw(10, 1.25)


def test_bytes_that_leave_in_turn_are_none() -> None:
    """A line that is written to all the time may always have some unsent."""
    watch = StallWatch(0.25)
    watch.saw(10, 1.0)
    for step in range(1, 50):
        now = 1.0 + step * 0.05
        watch.wrote(10, now)
        assert not watch.saw(10, now + 0.02), "those from before have been taken"
        assert watch.age_s(now + 0.02) < 0.03


def test_the_oldest_counts_however_much_comes_after() -> None:
    watch = StallWatch(0.25)
    for step in range(5):
        watch.saw(10 * (step + 1), 1.0 + step * 0.05)
    assert watch.age_s(1.2) > 0.19
    assert watch.saw(50, 1.25)


def test_a_part_that_leaves_makes_the_rest_the_oldest() -> None:
    watch = StallWatch(0.25)
    watch.saw(10, 1.0)
    watch.saw(20, 1.1)
    assert not watch.saw(10, 1.26)
    assert watch.deadline is not None
    assert abs(watch.deadline - 1.35) < 1e-9


def test_what_a_write_really_took_is_put_right() -> None:
    """Under TLS more bytes leave than were given; the count is not lost over it."""
    watch = StallWatch(0.25)
    watch.wrote(10, 1.0)
    watch.saw(32, 1.01)
    assert not watch.saw(0, 1.02)
    watch.wrote(10, 2.0)
    assert watch.age_s(2.1) < 0.11


def test_reset_begins_anew() -> None:
    watch = StallWatch(0.25)
    watch.saw(10, 1.0)
    watch.reset()
    assert not watch.saw(10, 5.0)


def test_marks_are_bounded() -> None:
    """Nobody looks while nothing moves: what is written meanwhile must not pile up."""
    watch = StallWatch(0.25)
    for step in range(10_000):
        watch.wrote(1, step * 0.01)
    assert watch.saw(10_000, 100.0)
    assert watch.age_s(100.0) == 100.0


def test_bytes_are_counted_whatever_left_before_them() -> None:
    watch = StallWatch(0.25)
    watch.wrote(100, 1.0)
    assert not watch.saw(60, 1.02)
    watch.wrote(50, 1.1)
    assert not watch.saw(110, 1.12)
    assert watch.deadline == 1.25, "of the first, some are still here"
    assert not watch.saw(50, 1.2)
    assert watch.deadline == 1.1 + 0.25, "of the first, none are"
    assert not watch.saw(50, 1.34)
    assert watch.saw(50, 1.36)


def test_a_single_byte_that_stays_is_a_stall() -> None:
    watch = StallWatch(0.25)
    assert not watch.saw(1, 1.0)
    assert watch.saw(1, 1.25)


def test_what_is_written_together_is_as_old_as_the_first_of_it() -> None:
    watch = StallWatch(0.25)
    watch.wrote(10, 1.0)
    watch.wrote(10, 1.004)
    watch.saw(10, 1.01)
    assert watch.deadline == 1.25


def test_a_line_that_takes_nothing_is_remembered_in_bounded_space() -> None:
    """And its oldest bytes stay the oldest."""
    watch = StallWatch(60.0)
    for number in range(1000):
        watch.wrote(10, 1.0 + number / 100)
    assert len(watch._marks) <= 256
    assert watch.deadline == 61.0


def test_what_was_given_up_stays_as_old_as_it_was() -> None:
    """Whatever follows it and leaves."""
    watch = StallWatch(0.25)
    watch.wrote(10, 1.0)
    watch.wrote(10, 1.1)
    watch.gave_up()
    assert watch.deadline == 1.25
    watch.wrote(10, 1.15)
    watch.saw(5, 1.2)
    assert watch.age_s(1.2) == 1.2 - 1.0


def test_first_bytes_are_as_old_as_their_write() -> None:
    watch = StallWatch(0.25)
    watch.wrote(10, 1.0)
    watch.saw(10, 1.1)
    watch.saw(1, 1.2)
    assert watch.deadline == 1.25
