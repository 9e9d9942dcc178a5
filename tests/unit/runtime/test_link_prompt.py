"""A transport that takes and gives at once: nothing is lost, overtaken or left unwatched."""

from collections.abc import Callable

import pytest

from tests.unit.runtime.test_link import ASK, opened, says_42, state_of, value_of
from urc.runtime.output_buffer import STUCK_S
from urc.testing.clock import FakeClock
from urc.testing.profile import line_profile
from urc.testing.transport import MemoryTransport
from urc.transports.base import Prompt

pytestmark = pytest.mark.anyio


class PromptTransport(MemoryTransport):
    """A memory transport that is a `Prompt`; what it was offered is in `offered`."""

    def __init__(self) -> None:
        super().__init__(answer=says_42)
        self.offered: list[bytes] = []
        self.takes_offers = True
        self.is_clogged = False
        self.sink: Callable[[bytes], bool] | None = None

    def offer(self, data: bytes) -> bool:
        """Take it, or leave it to `send`."""
        if self.takes_offers:
            self.offered.append(data)
        return self.takes_offers

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        """Remember where what arrives goes."""
        self.sink = sink


def test_memory_transport_alone_is_no_prompt() -> None:
    """Five members are enough for a transport; three more make it prompt."""
    assert isinstance(PromptTransport(), Prompt)
    assert not isinstance(MemoryTransport(), Prompt)


async def test_request_and_reply_need_no_task() -> None:
    """What is sent is offered at once, what arrives goes to the engine at once."""
    clock, line = FakeClock(), PromptTransport()
    async with opened(line, clock) as session:
        await clock.advance(1.5)
        assert (line.offered, line.sent) == ([ASK], [ASK])  # the first one, before anybody waits
        assert line.sink is not None
        assert line.sink(b"43\n")
        assert value_of(session) == 43
        assert state_of(session) == ("live", "")


async def test_offer_that_is_not_taken_is_sent() -> None:
    """The writer takes over, with the bytes as they were."""
    clock, line = FakeClock(), PromptTransport()
    line.takes_offers = False
    async with opened(line, clock) as session:
        assert (line.offered, line.sent) == ([], [ASK])
        assert value_of(session) == 42


async def test_offer_does_not_overtake_what_is_being_sent() -> None:
    """While the writer waits, later bytes wait behind."""
    clock, line = FakeClock(), PromptTransport()
    line.takes_offers = False
    line.stall_sends()
    async with opened(line, clock, line_profile(every_s=1.0)):
        line.takes_offers = True
        await clock.advance(1.5)
        assert (line.offered, line.sent) == ([], [])
        line.stall_sends(False)
        await clock.advance(0)
        assert b"".join(line.sent).startswith(ASK)
        assert line.offered == []


async def test_sink_refuses_what_is_much() -> None:
    """A flood is for the reader, which lets others have their turn."""
    clock, line = FakeClock(), PromptTransport()
    async with opened(line, clock):
        assert line.sink is not None
        assert not line.sink(b"note x\n" * 10_000)


async def test_bytes_that_the_kernel_never_takes_end_the_line() -> None:
    """An offer that is taken and stays unsent is watched as a send is."""
    clock, line = FakeClock(), PromptTransport()
    async with opened(line, clock) as session:
        line.is_clogged = True
        line.stall_sends()
        await clock.advance(1.0)
        assert line.offered == [ASK]
        await clock.advance(STUCK_S + 0.1)
        assert [note.text for note in session.hub.notes if "accepted no bytes" in note.text]
