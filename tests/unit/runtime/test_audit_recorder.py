"""What the controls leave in the audit says who moved what, why it stopped, and no secret."""

import pytest

from urc.motion.lease import LeaseState, Operator
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import HIDDEN, AuditRecorder
from urc.runtime.hub import AuditRecord, Hub, MotionRecord

ANN = Operator("s1", "screen 1", "drive")
BEN = Operator("s2", "screen 2", "maintain")


class Book:
    def __init__(self, *secrets: str) -> None:
        self.entries: list[AuditEntry] = []
        self.recorder = AuditRecorder(
            "rover", self.entries.append, utc=lambda: 99.0, secrets=secrets
        )

    @property
    def lines(self) -> list[str]:
        return [
            " ".join(f"{one.what} {one.who} {one.command} x{one.times} {one.outcome}".split())
            for one in self.entries
        ]


def test_a_motion_leaves_its_begin_and_its_end() -> None:
    book = Book()
    for number in range(20):
        book.recorder.moved(ANN, 7, "go", {"v": number}, b"V %d\n" % number, 10 + number / 20)
    book.recorder.stopped("go", "expired", 11.2)
    begin, end = book.entries
    assert begin == AuditEntry(
        99.0, "rover", "moved", "screen 1", "drive", "s1", 7, "go", '{"v": 0}', "5620300a",
        "begins",
    )  # fmt: skip
    assert end == AuditEntry(
        99.0, "rover", "stopped", "screen 1", "drive", "s1", 7, "go", '{"v": 19}', "562031390a",
        "expired", 20, 1.2,
    )  # fmt: skip


def test_who_keeps_all_that_happens_hears_of_each_tick_while_it_is_connected() -> None:
    """By the session's clock, whatever the time of day is."""
    book, hub = Book(), Hub({})
    book.recorder.attend(hub, lambda: 7.0)
    book.recorder.moved(ANN, 7, "go", {"v": 0}, b"", 1.0)
    with hub.tap() as tap:
        for number in (1, 2):
            book.recorder.moved(ANN, 7, "go", {"v": number}, b"", number)
        book.recorder.stopped("go", "expired", 3.0)
        *ticks, end = tap.drain()
        book.recorder.attend(None, lambda: 8.0)
        book.recorder.moved(ANN, 7, "go", {"v": 3}, b"", 9.0)
        assert tap.drain() == []
    assert ticks == [MotionRecord(1, "go", {"v": 1}), MotionRecord(2, "go", {"v": 2})]
    assert end == AuditRecord(7.0, book.entries[1])


def test_a_stop_of_what_stands_still_leaves_nothing() -> None:
    book = Book()
    book.recorder.stopped("go", "stopped", 1.0)
    assert book.entries == []


def test_another_hand_at_the_stick_is_another_motion() -> None:
    book = Book()
    book.recorder.moved(ANN, 7, "go", {}, b"", 1.0)
    book.recorder.moved(BEN, 8, "go", {}, b"", 1.5)
    assert book.lines == [
        "moved screen 1 go x1 begins",
        "stopped screen 1 go x1 taken over",
        "moved screen 2 go x1 begins",
    ]


def test_a_refusal_at_50_hz_is_told_once_a_second() -> None:
    book = Book()
    for number in range(101):
        book.recorder.refused(ANN, "go", "screen 2 has the controls", number / 50)
    assert book.lines == [
        "refused screen 1 go x1 screen 2 has the controls",
        "refused screen 1 go x50 screen 2 has the controls",
        "refused screen 1 go x50 screen 2 has the controls",
    ]


def test_refusals_of_many_kinds_are_forgotten_one_by_one_and_told_sixteen_a_second() -> None:
    book = Book()
    for number in range(1000):
        book.recorder.refused(ANN, "go", f"reason {number}", 1.0)
    assert len(book.entries) == 16
    assert len(book.recorder._refusals) == 64
    book.recorder.refused(ANN, "go", "reason 1000", 2.0)
    assert len(book.entries) == 17


def test_a_refusal_holds_a_bounded_text() -> None:
    book = Book()
    book.recorder.refused(ANN, "x" * 60_000, "y" * 60_000, 1.0)
    (found,) = book.entries
    assert (len(found.command), len(found.outcome)) == (100, 1000)


def test_a_mistake_in_here_reaches_nobody_and_is_told_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def broken(_: AuditEntry) -> None:
        raise RuntimeError("no")

    recorder = AuditRecorder("rover", broken, utc=lambda: 99.0)
    recorder.moved(ANN, 7, "go", {}, b"", 1.0)
    recorder.stopped("go", "released", 2.0)
    recorder.leased(LeaseState(1, ANN), 3.0)
    assert recorder.is_faulty
    told = [one.getMessage() for one in caplog.records]
    assert told == ["an event is missing from the audit log of rover"]


def test_secrets_that_come_later_are_hidden_too_and_the_longest_first() -> None:
    book = Book("hunter")
    book.recorder.hide(["hunter2"])
    book.recorder.ran(ANN, "say", {"text": "hunter2 hunter"}, "done")
    assert book.entries[0].arguments == f'{{"text": "{HIDDEN} {HIDDEN}"}}'


def test_an_answer_is_told_and_bytes_of_it_by_their_size() -> None:
    book = Book()
    book.recorder.ran(ANN, "look", {}, "done", answer={"picture": b"\x00" * 9, "angle": 2})
    assert book.entries[0].outcome == 'done: {"picture": "9 bytes", "angle": 2}'


def test_the_lease_and_the_latch_leave_a_line_each() -> None:
    book = Book()
    for state in (
        LeaseState(1, ANN),
        LeaseState(1, ANN, BEN, 10.0),
        LeaseState(2, BEN),
        LeaseState(3, None, latched_by="screen 1"),
        LeaseState(3, None, latched_by="screen 1"),
        LeaseState(4),
    ):
        book.recorder.leased(state, 1.0)
    assert book.lines == [
        "lease screen 1 x1 has the controls",
        "lease screen 2 x1 asks for the controls",
        "lease screen 2 x1 has the controls",
        "STOP x1 by screen 1",
        "lease screen 2 x1 gave the controls back",
        "reset x1 may be driven again",
    ]


def test_secrets_stay_out_of_arguments_bytes_and_messages() -> None:
    book = Book('pass"word', "")
    book.recorder.ran(
        ANN, "login", {"key": 'pass"word'}, 'pass"word is wrong', b'LOGIN pass"word\n'
    )
    (found,) = book.entries
    assert found.arguments == f'{{"key": "{HIDDEN}"}}'
    assert found.data == HIDDEN
    assert found.outcome == f"{HIDDEN} is wrong"


def test_a_command_leaves_what_it_came_to() -> None:
    book = Book()
    book.recorder.ran(ANN, "arm", {}, "done", b"ARM\n")
    assert book.lines == ["ran screen 1 arm x1 done"]
    assert book.entries[0].data == "41524d0a"
