"""A program that is asked for signs of life, and stands still."""

from math import inf

from urc.motion.liveness import ASKED_EVERY_S, SILENCE_S, Liveness


def test_unanswered_question_is_waited_for_within_half_a_second_of_the_last_sign() -> None:
    """Also where the program stood still right after an answer, and the next question was due."""
    hearing = Liveness(None)
    hearing.note_arrival(10.0)
    assert hearing.deadline == inf, "nothing is expected of it"
    hearing.asked(10.0 + ASKED_EVERY_S)
    hearing.asked(10.0 + 2 * ASKED_EVERY_S)
    assert 10.0 + SILENCE_S - 0.1 < hearing.deadline < 10.0 + SILENCE_S
    hearing.note_arrival(10.2)
    assert hearing.deadline == inf


def test_silence_counts_without_a_question_where_the_robot_is_to_talk() -> None:
    hearing = Liveness(2.0)
    hearing.note_arrival(10.0)
    assert hearing.deadline == 12.0
    hearing.note_arrival(11.0)
    hearing.asked(11.1)
    assert hearing.deadline < 11.6


def test_question_stands_until_something_comes() -> None:
    hearing = Liveness(None)
    assert not hearing.is_asked
    hearing.asked(10.0)
    assert hearing.is_asked
    hearing.note_arrival(10.1)
    assert not hearing.is_asked
