"""What stands below an SSH connection, over a line of the test's own."""

import asyncio

import pytest

from urc.transports.ssh_wire import UNTAKEN_BYTES, SshSocket

pytestmark = pytest.mark.anyio


class Line(asyncio.Transport):
    """Takes `kernel` bytes, and holds the rest."""

    def __init__(self, kernel: float) -> None:
        super().__init__()
        self.kernel = kernel
        self.held = 0
        self.is_cut = False

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        assert high == 0

    def get_write_buffer_size(self) -> int:
        return self.held

    def write(self, data: object) -> None:
        size = len(data)  # type: ignore[arg-type] # bytes
        taken = min(self.kernel, size)
        self.kernel -= taken
        self.held += int(size - taken)

    def abort(self) -> None:
        self.is_cut = True

    def close(self) -> None:
        self.is_cut = True


class Polite(asyncio.Protocol):
    """Answers everything with as much."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, Line)
        self._line = transport

    def data_received(self, data: bytes) -> None:
        self._line.write(data)


def asked(line: Line, times: int) -> SshSocket:
    wire = SshSocket(Polite())
    wire.connection_made(line)
    for _ in range(times):
        if not line.is_cut:
            wire.passes(bytes(65536))
    return wire


async def test_answers_that_nobody_takes_end_the_line() -> None:
    """They are not heaped up for as long as the server asks."""
    wire = asked(line := Line(kernel=100_000), 1000)
    assert line.is_cut
    assert line.held <= UNTAKEN_BYTES + 65536
    assert "does not read the replies" in wire.fault


async def test_answers_that_are_taken_do_not() -> None:
    """However many there are."""
    wire = asked(line := Line(kernel=float("inf")), 1000)
    assert not line.is_cut
    assert wire.fault == ""


async def test_what_breaks_after_the_end_is_not_the_reason() -> None:
    """An answer that was under way meets a line that the server has closed."""
    wire = asked(Line(kernel=float("inf")), 1)
    assert wire.eof_received(), "it stays open until all is read"
    wire.connection_lost(BrokenPipeError(32, "Broken pipe"))
    assert wire.fault == "", "what came before is read first"
    async with asyncio.timeout(10):
        await wire.gone()
    assert wire.fault == "the robot closed the connection"
