"""What happens around the robots has a name in the audit, and no secret."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from urc.runtime.audit import AuditLog
from urc.runtime.audit_check import exported
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.secret_forms import forms
from urc.runtime.server_recorder import Actor, ServerRecorder, terminal_actor

ANN = Actor("Ann", "p1", "person", "administer", "passkey", "192.0.2.7", "k1")


class ServerBook:
    def __init__(self, *secrets: str) -> None:
        self.entries: list[AuditEntry] = []
        self.utc_s = 5000.0
        self.now_s = 10.0
        self.recorder = ServerRecorder(
            self.entries.append, utc=lambda: self.utc_s, now=lambda: self.now_s, secrets=secrets
        )

    def wait(self, seconds: float) -> None:
        self.now_s += seconds
        self.utc_s += seconds

    @property
    def lines(self) -> list[str]:
        return [
            " ".join(
                f"{one.what} {one.robot} {one.who} {one.command} {one.arguments} {one.place}"
                f" x{one.times} {one.outcome}".split()
            )
            for one in self.entries
        ]


def test_entry_names_person_way_role_and_place() -> None:
    book = ServerBook()
    book.recorder.signed_in(ANN, "Chromium on Android")
    assert book.entries == [
        AuditEntry(
            5000.0, "", "signed in", "Ann", "administer", "k1", outcome="Chromium on Android",
            principal="p1", kind="person", way="passkey", place="192.0.2.7",
        )
    ]  # fmt: skip


def test_each_event_has_its_line() -> None:
    book = ServerBook()
    recorder = book.recorder
    recorder.server("started", "1.2.3", address="http://127.0.0.1:8080/")
    recorder.signed_out(ANN)
    recorder.revoked(ANN, "device", name="Tablet")
    recorder.paired(ANN, "code made", name="Tablet")
    recorder.access_changed(ANN, "people grant", name="Ben", roles="drive@#lab")
    recorder.settings_changed(ANN, "rover", {"host": "192.0.2.1", "password": None})
    recorder.package_changed(ANN, "install", ["drivers/puppet 1.0.0"])
    recorder.recording(ANN, "rover", "downloaded", "rover.mcap")
    recorder.server("ended", "1.2.3")
    assert book.lines == [
        'server started {"version": "1.2.3", "address": "http://127.0.0.1:8080/"} x1',
        "signed out Ann 192.0.2.7 x1",
        'revoked Ann device {"name": "Tablet"} 192.0.2.7 x1',
        'pairing Ann code made {"name": "Tablet"} 192.0.2.7 x1',
        'access Ann people grant {"name": "Ben", "roles": "drive@#lab"} 192.0.2.7 x1',
        'settings rover Ann {"host": "192.0.2.1", "password": "•••"} 192.0.2.7 x1 saved',
        'package Ann install {"packages": ["drivers/puppet 1.0.0"]} 192.0.2.7 x1 done',
        'recording rover Ann downloaded {"file": "rover.mcap"} 192.0.2.7 x1',
        'server ended {"version": "1.2.3"} x1',
    ]


def test_failed_sign_ins_are_counted_and_told_once_a_second() -> None:
    book = ServerBook()
    for _ in range(50):
        book.recorder.sign_in_failed("passphrase", "192.0.2.9", "wrong passphrase")
        book.wait(1 / 50)
    book.wait(1)
    book.recorder.flush()
    assert book.lines == [
        "sign-in failed 192.0.2.9 x1 wrong passphrase",
        "sign-in failed 192.0.2.9 x49 wrong passphrase",
    ]
    book.recorder.flush()
    assert len(book.lines) == 2


def test_name_that_was_tried_is_told_only_if_a_person_has_it() -> None:
    """People type passphrases into the field of the name."""
    book = ServerBook()
    failed = book.recorder.sign_in_failed
    failed("passphrase", "192.0.2.9", "wrong passphrase", name="Ann", principal="p1")
    failed("passphrase", "192.0.2.9", "unknown name", name="correct horse battery")
    assert [(one.who, one.principal) for one in book.entries] == [("Ann", "p1"), ("", "")]


def test_attack_from_many_addresses_fills_no_log_and_is_counted() -> None:
    """A day of it takes less than a tenth of the log, so older entries stay."""
    book = ServerBook()
    attempts = 0
    for second in range(600):
        for number in range(20):
            place = f"2001:db8::{second % 500:x}:{number:x}"
            book.recorder.sign_in_failed("passphrase", place, "wrong passphrase")
            attempts += 1
        book.wait(1)
        book.recorder.flush()
    told = len(book.entries)
    book.recorder.server("ended", "1.2.3")
    failed = [one for one in book.entries if one.what == "sign-in failed"]
    assert sum(one.times for one in failed) == attempts
    assert told <= 60 + 600 // 10
    size = len(json.dumps(book.entries))
    assert 24 * 6 * size < 10_000_000


def test_stop_of_unknown_visitors_is_limited_and_told() -> None:
    book = ServerBook()
    for _ in range(1000):
        book.recorder.stopped_by_unknown("rover", "192.0.2.9")
    book.recorder.server("ended", "1.2.3")
    assert book.lines[:2] == [
        "STOP rover 192.0.2.9 x1 pressed without a sign-in",
        "STOP rover 192.0.2.9 x999 pressed without a sign-in",
    ]


def test_jump_of_the_clock_is_told_once() -> None:
    book = ServerBook()
    book.wait(100)
    book.recorder.check_clock()
    book.utc_s += 86_400 * 365
    book.recorder.check_clock()
    book.recorder.check_clock()
    book.utc_s -= 60
    book.recorder.check_clock()
    assert book.lines == [
        "clock x1 the clock jumped ahead by 31536000 s: it was set, or the machine slept",
        "clock x1 the clock jumped back by 60 s: it was set, or the machine slept",
    ]


def test_mistake_in_here_reaches_nobody_and_is_told_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def broken(_: AuditEntry) -> None:
        raise RuntimeError("no")

    recorder = ServerRecorder(broken)
    recorder.signed_in(ANN)
    recorder.stopped_by_unknown("rover", "192.0.2.9")
    assert recorder.is_faulty
    told = [one.getMessage() for one in caplog.records]
    assert told == ["an event is missing from the audit log"]


@pytest.mark.skipif(os.name != "posix", reason="POSIX users")
def test_user_of_a_terminal_has_the_name_of_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the name of a variable, which every user can set."""
    import pwd

    for variable in ("LOGNAME", "USER", "LNAME", "USERNAME"):
        monkeypatch.setenv(variable, "eve")
    mine = pwd.getpwuid(os.getuid()).pw_name
    assert terminal_actor().name == f"{mine} on this computer"

    def unknown(_: int) -> None:
        raise KeyError("uid 4711")

    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert terminal_actor().name == f"user {os.getuid()} on this computer"


CANARIES = {
    "start key": "canary-start-key-p3nTq7Zz",
    "token": "canary-token-of-a-program-0a1b2c3d",
    "sign-in": "canary-sign-in-of-a-browser-9f8e7d",
    "passphrase": 'canary "passphrase" with ümlauts & 空',
}

_EVENTS: list[Callable[[ServerRecorder, str], None]] = [
    lambda book, word: book.signed_in(ANN._replace(name=f"Ann {word}"), f"Chromium {word}"),
    lambda book, word: book.sign_in_failed("token", "192.0.2.9", f"bad token {word}"),
    lambda book, word: book.revoked(ANN, f"token {word}", name=word),
    lambda book, word: book.paired(ANN, "code used", name="Tablet", code=word),
    lambda book, word: book.access_changed(ANN, "tokens add", more={"token": [word]}),
    lambda book, word: book.settings_changed(ANN, "rover", {"host": f"http://ann:{word}@h/"}),
    lambda book, word: book.package_changed(ANN, "install", [f"https://u:{word}@h/"], word),
    lambda book, word: book.recording(ANN, "rover", "started", f"{word}.mcap", word),
    lambda book, word: book.server("started", "1", address=f"http://h/?key={word}"),
]


@pytest.mark.parametrize("kind", CANARIES)
def test_known_secrets_are_in_no_form_in_the_file(kind: str, tmp_path: Path) -> None:
    """Not in the SQLite files, and not in an export, in whatever field a caller puts them."""
    canary = CANARIES[kind]
    file = tmp_path / "audit.sqlite"
    with AuditLog(file) as log:
        recorder = ServerRecorder(log.add, secrets=[canary])
        for event in _EVENTS:
            event(recorder, canary)
        assert log.settle()
        data = b"".join(one.read_bytes() for one in sorted(tmp_path.iterdir()))
        text = "".join(exported(file))
    assert text.count("\n") == len(_EVENTS)
    for form in forms(canary):
        assert form.encode() not in data
        assert form not in text


def test_passphrases_in_addresses_are_hidden_even_if_unknown() -> None:
    book = ServerBook()
    book.recorder.settings_changed(ANN, "rover", {"url": "rtsp://admin:hunter2@192.0.2.1/live"})
    assert "hunter2" not in book.lines[0]
    assert "rtsp://•••@192.0.2.1/live" in book.lines[0]
