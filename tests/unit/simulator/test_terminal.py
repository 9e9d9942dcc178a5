"""The terminal of an emulated server: any end of a line will do, and all is echoed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.model.driver import FramingSpec, TransportSpec
from urc.simulator.servers.terminal import TerminalInput, echo_of


def keys(tx: bytes, *, kind: str = "delimiter") -> TerminalInput:
    framing = FramingSpec(kind, {"tx": tx, "rx": b"\n"})
    return TerminalInput(TransportSpec("wire", "telnet", framing=framing))


@pytest.mark.parametrize("typed", [b"go\r", b"go\n", b"go\r\n"])
@pytest.mark.parametrize("declared", [b"\r", b"\n", b"\r\n"])
def test_line_ends_as_the_driver_declares(typed: bytes, declared: bytes) -> None:
    """A person's client sends CR, another one CR LF, URC what the document says."""
    assert keys(declared).read(typed) == b"go" + declared


@pytest.mark.parametrize("declared", [b";", b"\0", b"\n\r"])
def test_other_delimiters_leave_bytes_alone(declared: bytes) -> None:
    """Then CR and LF are bytes like others."""
    assert keys(declared).read(b"a\r\nb\rc;") == b"a\r\nb\rc;"
    assert keys(b"\n", kind="length").read(b"a\r\n") == b"a\r\n"


@given(st.lists(st.sampled_from([b"\r", b"\n", b"\r\n", b"x", b""]), max_size=12))
def test_line_end_in_two_pieces_is_one(pieces: list[bytes]) -> None:
    """However it is cut."""
    cut, whole = keys(b"\n"), keys(b"\n")
    assert b"".join(map(cut.read, pieces)) == whole.read(b"".join(pieces))


def test_echo_is_what_a_person_sees() -> None:
    """Each line on a line of its own."""
    assert echo_of(b"one\rtwo\nthree\r\n") == b"one\r\ntwo\r\nthree\r\n"
