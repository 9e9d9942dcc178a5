"""When the next of a row of things is due."""

import pytest

from urc.motion.rhythm import Rhythm


def test_the_next_is_due_after_the_shortest_of_the_last_gaps() -> None:
    """One that was late is no reason to expect the next ones late; a new pace is soon known."""
    rhythm = Rhythm()
    assert rhythm.take(10.0) is None, "one is no row"
    assert rhythm.take(10.05) == pytest.approx(10.1)
    assert rhythm.take(10.12) == pytest.approx(10.17)
    assert rhythm.take(10.17) == pytest.approx(10.22)
    now, due = 10.17, 0.0
    for _ in range(4):
        now += 0.1
        due = rhythm.take(now) or 0.0
    assert due == pytest.approx(now + 0.1)


def test_what_comes_together_counts_once() -> None:
    """Two sticks are held: their samples come in pairs."""
    rhythm = Rhythm()
    for now in (10.0, 10.05, 10.1):
        rhythm.take(now)
        assert rhythm.take(now + 0.001) == (None if now == 10.0 else pytest.approx(now + 0.05))


def test_after_a_pause_nothing_is_known() -> None:
    """The next hand may have another pace."""
    rhythm = Rhythm()
    rhythm.take(10.0)
    assert rhythm.take(10.02) is not None
    assert rhythm.take(11.0) is None
    assert rhythm.take(11.05) == pytest.approx(11.1)
