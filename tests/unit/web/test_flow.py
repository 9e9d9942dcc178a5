"""The socket below a client: when it may be written to past the transport, and when no more."""

from typing import Any, cast

import pytest

from urc.web.feed.crowd import NO_NUMBER
from urc.web.feed.flow import SocketFlow


class Line:
    """A socket, and the transport over it."""

    def __init__(self, **known: object) -> None:
        self.known = {"socket": self, "sslcontext": None, **known}
        self.written: list[bytes] = []
        self.is_over = False

    def fileno(self) -> int:
        return 7

    def get_extra_info(self, name: str) -> object:
        return self.known[name]

    def set_write_buffer_limits(self, high: int) -> None:
        assert high == 0, "the client hears of the first byte that waits"

    def is_closing(self) -> bool:
        return self.is_over

    def write(self, data: bytes) -> None:
        self.written.append(data)


def made(line: Line) -> tuple[SocketFlow, list[int]]:
    """Return the flow of a line, and a list that grows when it is not to be written to."""
    flow, told = SocketFlow(), list[int]()
    flow.made(cast(Any, line))
    flow.direct(lambda: told.append(flow.direct(lambda: None)))
    return flow, told


def test_a_plain_socket_has_a_number_and_an_encrypted_one_none() -> None:
    """What is written past the transport would go out unencrypted."""
    assert made(Line())[0].direct(lambda: None) == 7
    assert made(Line(sslcontext=object()))[0].direct(lambda: None) == NO_NUMBER
    assert made(Line(socket=None))[0].direct(lambda: None) == NO_NUMBER
    assert SocketFlow().direct(lambda: None) == NO_NUMBER


def test_a_full_line_is_told_at_once_and_may_be_used_again() -> None:
    """Until the kernel has taken everything it is not free."""
    flow, told = made(Line())
    flow.pause()
    assert (told, flow.is_free()) == ([7], False)
    flow.resume()
    assert flow.is_free()


@pytest.mark.parametrize("how", ["lost", "closing"])
def test_the_number_ends_before_it_can_be_another_ones(how: str) -> None:
    """It is told, and is none from then on."""
    flow, told = made(Line())
    getattr(flow, how)()
    assert told == [NO_NUMBER]


def test_nothing_is_written_after_the_goodbye() -> None:
    """The transport would only complain."""
    line = Line()
    flow, _ = made(line)
    flow.write(b"one")
    line.is_over = True
    flow.write(b"two")
    assert line.written == [b"one"]
