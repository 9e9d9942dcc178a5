"""The socket below a client: whether it is free, and what may be written to it."""

from typing import Any, cast

from urc.web.feed.client_socket import SocketFlow


class Line:
    """A socket, and the transport over it."""

    def __init__(self) -> None:
        self.written: list[bytes] = []
        self.is_over = False

    def set_write_buffer_limits(self, high: int) -> None:
        assert high == 0, "the client hears of the first byte that waits"

    def is_closing(self) -> bool:
        return self.is_over

    def write(self, data: bytes) -> None:
        self.written.append(data)


def made(line: Line) -> SocketFlow:
    """Return the flow of a line."""
    flow = SocketFlow()
    flow.connected(cast(Any, line))
    return flow


def test_a_full_line_is_not_free_until_the_kernel_has_taken_everything() -> None:
    """A lost one lets its writer go on, too."""
    flow = made(Line())
    assert flow.is_free()
    flow.pause()
    assert not flow.is_free()
    flow.resume()
    assert flow.is_free()
    flow.pause()
    flow.lost()
    assert flow.is_free()


def test_nothing_is_written_after_the_goodbye() -> None:
    """The transport would only complain."""
    line = Line()
    flow = made(line)
    flow.write(b"one")
    line.is_over = True
    flow.write(b"two")
    assert line.written == [b"one"]
