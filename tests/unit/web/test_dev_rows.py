"""Rows of the wire log of the dev page."""

from urc.model.payload import Envelope
from urc.runtime.hub import Traffic
from urc.web.dev.rows import traffic_row


def test_a_message_is_shown_by_its_parts() -> None:
    """Where it goes, the other attributes, and the body."""
    sent = Envelope(
        "request", {"method": "GET", "path": "/login", "headers": {"x": "1"}}, {"ask": "ü"}
    )
    row = traffic_row(Traffic(1.0, "web", "sent", b"", sent))
    assert (row.verb, row.address, row.more) == ("request", "GET /login", "headers={'x': '1'}")
    assert (row.text, row.size) == ('{"ask": "ü"}', 13)


def test_a_picture_is_a_picture_and_its_size() -> None:
    """A large one is only counted."""
    small = b"\xff\xd8\xff" + bytes(2000)
    message = Envelope("message", {"topic": "/c"}, small)
    row = traffic_row(Traffic(1.0, "cam", "received", b"", message))
    assert (row.picture, row.data, row.text) == (
        "image/jpeg",
        small,
        "<2\u202f003 bytes, image/jpeg>",
    )
    row = traffic_row(Traffic(1.0, "cam", "received", b"\xff\xd8\xff" + bytes(100_000)))
    assert (row.picture, row.data) == ("", b"")
    assert row.text == "<100\u202f003 bytes, image/jpeg>"
