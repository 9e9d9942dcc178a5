"""A program that is asked for signs of life, and stands still."""

from math import inf

from urc.motion.liveness import ASKED_EVERY_S, GATHERED_S, SILENCE_S, Liveness


def test_unanswered_question_is_waited_for_within_half_a_second_of_the_last_sign() -> None:
    """Also where the program stood still right after an answer, and the next question was due."""
    liveness = Liveness(None)
    liveness.note_arrival(10.0)
    assert liveness.deadline == inf, "nothing is expected of it"
    liveness.asked(10.0 + ASKED_EVERY_S)
    liveness.asked(10.0 + 2 * ASKED_EVERY_S)
    assert 10.0 + SILENCE_S - 0.1 < liveness.deadline < 10.0 + SILENCE_S
    liveness.note_arrival(10.2)
    assert liveness.deadline == inf


def test_silence_counts_without_a_question_where_the_robot_is_to_talk() -> None:
    liveness = Liveness(2.0)
    liveness.note_arrival(10.0)
    assert liveness.deadline == 12.0
    liveness.note_arrival(11.0)
    liveness.asked(11.1)
    assert liveness.deadline < 11.6


def test_question_stands_until_something_comes() -> None:
    liveness = Liveness(None)
    assert not liveness.is_asked
    liveness.asked(10.0)
    assert liveness.is_asked
    liveness.note_arrival(10.1)
    assert not liveness.is_asked


def test_gathered_data_from_before_a_freeze_do_not_prolong_the_silence() -> None:
    """Delivered late, they look like a sign of life; the next probe follows an interval later."""
    liveness, frozen_s = Liveness(None), 10.0
    liveness.note_arrival(frozen_s + GATHERED_S)
    liveness.asked(frozen_s + GATHERED_S + ASKED_EVERY_S)
    assert liveness.deadline < frozen_s + SILENCE_S - 0.025, "and the reset needs time, too"
