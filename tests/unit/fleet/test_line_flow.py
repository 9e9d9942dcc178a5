"""Bytes of a line arrive in order, and a slow receiver stops the sender."""

import pytest

from urc.fleet.line_flow import PART_BYTES, WINDOW_BYTES, Incoming, LineBroken, Outgoing


def test_small_writes_leave_at_once_with_their_positions() -> None:
    """Each message says where its bytes belong."""
    out = Outgoing()
    out.write(b"one")
    assert out.take() == (0, b"one")
    out.write(b"two")
    assert out.take() == (3, b"two")
    assert out.take() is None


def test_the_window_keeps_bytes_back_until_they_are_confirmed() -> None:
    """A receiver that confirms nothing gets one window and no more."""
    out = Outgoing()
    out.write(bytes(WINDOW_BYTES + 10))
    sent = 0
    while (part := out.take()) is not None:
        assert len(part[1]) <= PART_BYTES
        sent += len(part[1])
    assert (sent, out.waiting) == (WINDOW_BYTES, 10)
    out.confirm(4)
    assert out.take() == (WINDOW_BYTES, bytes(4))
    assert out.take() is None


def test_an_old_confirmation_changes_nothing() -> None:
    """Confirmations count from the beginning of the line."""
    out = Outgoing()
    out.write(bytes(100))
    out.take()
    out.confirm(100)
    out.confirm(60)
    assert out.unconfirmed == 0


def test_a_confirmation_of_unsent_bytes_breaks_the_line() -> None:
    """The other site cannot widen the window by a lie."""
    out = Outgoing()
    out.write(b"abc")
    out.take()
    with pytest.raises(LineBroken, match="4 bytes are confirmed, but only 3 were sent"):
        out.confirm(4)


def test_a_gap_breaks_the_line() -> None:
    """A stream with missing bytes is worthless."""
    incoming = Incoming()
    incoming.receive(0, b"abc")
    with pytest.raises(LineBroken, match="2 bytes are missing"):
        incoming.receive(5, b"d")


def test_bytes_that_arrive_twice_have_two_senders() -> None:
    """The network delivers a message once, so a copied certificate is in use."""
    incoming = Incoming()
    incoming.receive(0, b"abc")
    with pytest.raises(LineBroken, match="two servers use the certificate of the site"):
        incoming.receive(0, b"abc")


def test_a_sender_that_ignores_the_window_breaks_the_line() -> None:
    """Received bytes that nobody reads are bounded."""
    incoming = Incoming()
    incoming.receive(0, bytes(WINDOW_BYTES))
    with pytest.raises(LineBroken, match="unconfirmed bytes arrived"):
        incoming.receive(WINDOW_BYTES, b"x")


def test_processed_bytes_are_confirmed_once() -> None:
    """An eighth of the window is worth a message; less waits for more."""
    incoming = Incoming()
    incoming.receive(0, bytes(WINDOW_BYTES // 8))
    incoming.process(10)
    assert not incoming.is_due
    incoming.process(WINDOW_BYTES // 8 - 10)
    assert incoming.is_due
    assert incoming.confirmation() == WINDOW_BYTES // 8
    assert incoming.confirmation() is None
