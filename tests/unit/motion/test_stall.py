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
