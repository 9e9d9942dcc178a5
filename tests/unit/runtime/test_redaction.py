"""Secrets in the wire log: taken out of frames, texts and streams, however they arrive."""

import base64

import pytest

from urc.runtime.redaction import REDACTED, Redactor

HIDDEN = "hunter2"
KEY = ("wire", "received")


def test_a_secret_is_taken_out_of_a_frame() -> None:
    """Everywhere in it, and nothing else is."""
    redactor = Redactor([HIDDEN])
    assert redactor.whole(b"LOGIN a hunter2\nhunter2!") == (
        b"LOGIN a " + REDACTED + b"\n" + REDACTED + b"!"
    )
    assert redactor.whole(b"hunter") == b"hunter"
    assert Redactor([""]).whole(b"as it is") == b"as it is"


def test_a_short_secret_blanks_the_whole_frame() -> None:
    """Taking two letters out of everything would say which they are."""
    assert Redactor(["42"]).whole(b"PIN 42\n") == REDACTED


@pytest.mark.parametrize("before", ["", "u", "us", "user:"])
def test_a_secret_inside_of_base64_is_found(before: str) -> None:
    """As in a header for log-in, wherever in the text it begins."""
    code = base64.b64encode(f"{before}correct horse battery".encode())
    assert REDACTED in Redactor(["correct horse battery"]).whole(b"Basic " + code)


def test_an_echo_letter_by_letter_is_never_shown() -> None:
    """What may begin a secret waits; whatever else it turns out to be is shown."""
    redactor = Redactor([HIDDEN])
    shown = [redactor.stream(KEY, bytes([letter])) for letter in b"pw: hunter2\r\nhi"]
    shown += [data for _, data in redactor.rest()]
    assert b"".join(shown) == b"pw: " + REDACTED + b"\r\nhi"
    assert all(b"hun" not in piece for piece in shown)


def test_a_beginning_that_nothing_follows_is_blanked_too() -> None:
    """Most of a password is as good as all of it; a letter or two are nothing."""
    redactor = Redactor([HIDDEN])
    assert redactor.stream(KEY, b"hunter") == b""
    assert redactor.rest() == [(KEY, REDACTED)]
    assert redactor.stream(KEY, b"oh") == b"o"
    assert redactor.rest() == [(KEY, b"h")]
    assert redactor.rest() == []


def test_streams_are_told_apart() -> None:
    """What one line says does not go on on another."""
    redactor = Redactor([HIDDEN])
    assert redactor.stream(("a", "sent"), b"hunt") == b""
    assert redactor.stream(("b", "sent"), b"er2") == b"er2"
