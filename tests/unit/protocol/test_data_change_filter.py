"""Changes too small to be news, and flips too short to be."""

import pytest

from tests.dialogue import Dialogue
from urc.model.values import AlarmLimits, Signal
from urc.protocol.readings.readings import Readings

BAND = Signal("v", deadband=0.5, limits=AlarmLimits(low=10.0), stale_after_s=3)


def told(signal: Signal, *values_at: tuple[float, object]) -> list[tuple[object, float, str]]:
    """Return value, time and alarm of every sample that readings at these times give."""
    readings = Readings({signal.name: signal})
    found = []
    for time, value in values_at:
        for sample in readings.set_values({signal.name: value}, time)[0]:
            found.append((sample.value, sample.time_s, sample.alarm))
    return found


def test_a_small_change_is_no_news_but_shows_that_the_robot_speaks() -> None:
    """The last value stands, read anew; small steps add up against it."""
    assert told(BAND, (0, 12), (1, 12.4), (2, 11.6), (3, 12.5), (4, 12.9)) == [
        (12, 0, ""), (12, 1, ""), (12, 2, ""), (12.5, 3, ""), (12.5, 4, ""),
    ]  # fmt: skip


def test_a_change_of_alarm_is_always_news() -> None:
    """However small the step over the limit is."""
    assert told(BAND, (0, 10.1), (1, 10.0)) == [(10.1, 0, ""), (10.0, 1, "low")]


def test_an_array_is_news_when_one_of_its_elements_is() -> None:
    """Or when it has another length."""
    cells = Signal("v", "array", deadband=0.5)
    assert [value for value, _, _ in told(cells, (0, [1, 2]), (1, [1.2, 2.2]), (2, [1, 2.5]))] == [
        (1, 2), (1, 2), (1, 2.5),
    ]  # fmt: skip
    assert told(cells, (0, [1, 2]), (1, [1]))[-1][0] == (1,)


def test_nothing_and_something_are_never_the_same() -> None:
    """A value that is not available is news."""
    assert [value for value, _, _ in told(BAND, (0, 12), (1, None), (2, 12))] == [12, None, 12]


DOOR = Signal("v", "boolean", debounce_s=0.05, stale_after_s=3)


def test_a_flip_that_is_shorter_is_no_news() -> None:
    """The first value counts at once: there is nothing to flip from."""
    assert told(DOOR, (0, True), (1.00, False), (1.02, True), (1.03, False), (1.09, False)) == [
        (True, 0, ""), (True, 1.02, ""), (False, 1.09, ""),
    ]  # fmt: skip


def test_a_value_that_lasts_counts_even_if_the_robot_says_nothing_more() -> None:
    """Time alone makes it news; what is computed from it follows."""
    talk = Dialogue(
        """
signals:
  door: { type: string, debounce: 50ms }
  shout: { type: string, value: door | upper }
messages: { door: { regex: '^DOOR (?P<door>\\w+)$' } }
"""
    ).connect()
    talk.says("DOOR open")
    talk.at(1.0).says("DOOR shut")
    assert talk.at(1.04).values == {"door": "open", "shout": "OPEN"}
    assert talk.at(1.05).values == {"door": "shut", "shout": "SHUT"}
    assert talk.engine.deadline is None


@pytest.mark.parametrize("frames", [1, 40])
def test_made_functions_know_of_it(frames: int) -> None:
    """What is made after some frames gives the same as before."""
    talk = Dialogue(
        "signals: { v: { deadband: 0.5 } }\nmessages: { v: { regex: '^V (?P<v>[0-9.]+)$' } }"
    ).connect()
    for turn in range(frames):
        talk.says(f"V {1 + turn % 2 * 0.3}")
    assert talk.values == {"v": 1}
