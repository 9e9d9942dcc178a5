"""Lines between sites carry bytes as TCP does, and end when a byte or a site is lost."""

import asyncio

import pytest

from urc.fleet.line_flow import WINDOW_BYTES
from urc.fleet.lines import LINES_PER_SITE, Lines, SiteAbsent
from urc.testing.fleet_bus import FakeFleetNetwork

pytestmark = pytest.mark.anyio


class Notes(asyncio.Protocol):
    """A protocol that notes what happens to it."""

    def __init__(self) -> None:
        self.got = bytearray()
        self.transport: asyncio.Transport | None = None
        self.is_paused = False
        self.ended: list[str] = []

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.got += data

    def pause_writing(self) -> None:
        self.is_paused = True

    def resume_writing(self) -> None:
        self.is_paused = False

    def connection_lost(self, exc: Exception | None) -> None:
        self.ended.append(str(exc or ""))

    @property
    def line(self) -> asyncio.Transport:
        assert self.transport is not None
        return self.transport


class Places:
    """Two sites, bern and genf; genf accepts lines."""

    def __init__(self) -> None:
        self.network = FakeFleetNetwork()
        self.accepted: list[Notes] = []
        self.buses = [self.network.bus("bern"), self.network.bus("genf")]
        self.bern = Lines(self.buses[0])
        self.genf = Lines(self.buses[1], self._accept)

    async def open(self) -> "Places":
        for bus in self.buses:
            await bus.open()
        return self

    def _accept(self) -> Notes:
        self.accepted.append(Notes())
        return self.accepted[-1]

    async def dialled(self) -> tuple[Notes, Notes]:
        """Return both ends of a new line from bern to genf."""
        near = Notes()
        self.bern.dial("genf", "control", near)
        await turns()
        return near, self.accepted[-1]


async def turns(count: int = 30) -> None:
    """Let the event loop run for some turns."""
    for _ in range(count):
        await asyncio.sleep(0)


async def test_bytes_pass_in_both_directions() -> None:
    """The dialling end may write at once."""
    places = await Places().open()
    near = Notes()
    places.bern.dial("genf", "control", near)
    near.line.write(b"hello")
    await turns()
    far = places.accepted[0]
    far.line.write(b"good day")
    await turns()
    assert (bytes(far.got), bytes(near.got)) == (b"hello", b"good day")
    assert far.line.get_extra_info("peername") == ("bern", 0)


async def test_a_receiver_that_does_not_read_stops_the_sender() -> None:
    """Nothing grows without bound, and reading on delivers everything."""
    places = await Places().open()
    near, far = await places.dialled()
    far.line.pause_reading()
    near.line.write(bytes(3 * WINDOW_BYTES))
    await turns()
    assert near.is_paused
    assert near.line.get_write_buffer_size() == 2 * WINDOW_BYTES
    assert not far.got
    far.line.resume_reading()
    await turns(100)
    assert not near.is_paused
    assert len(far.got) == 3 * WINDOW_BYTES


async def test_a_lost_message_ends_both_ends_with_the_reason() -> None:
    """A gap is noticed with the next message."""
    places = await Places().open()
    near, far = await places.dialled()
    places.network.loses = lambda sender, site, body: b"lost" in body
    near.line.write(b"lost")
    near.line.write(b"next")
    await turns()
    assert near.ended == far.ended == ["4 bytes are missing"]
    assert not far.got


async def test_a_site_that_leaves_ends_its_lines() -> None:
    """A killed server is noticed by its presence."""
    places = await Places().open()
    near, far = await places.dialled()
    places.network.cut("bern", "genf")
    await turns()
    assert near.ended == far.ended == [""]
    with pytest.raises(SiteAbsent, match="the site genf cannot be reached"):
        places.bern.dial("genf", "data", Notes())


async def test_close_sends_the_waiting_bytes_first() -> None:
    """As with TCP, written bytes arrive before the end."""
    places = await Places().open()
    near, far = await places.dialled()
    near.line.write(bytes(2 * WINDOW_BYTES))
    near.line.close()
    await turns(100)
    assert len(far.got) == 2 * WINDOW_BYTES
    assert near.ended == far.ended == [""]


async def test_a_site_without_a_server_refuses_lines() -> None:
    """The dialling end learns the reason."""
    places = await Places().open()
    near = Notes()
    places.genf.dial("bern", "control", near)
    await turns()
    assert near.ended == ["this site accepts no lines"]


async def test_one_site_cannot_open_lines_without_end() -> None:
    """The limit holds for each site."""
    places = await Places().open()
    ends = [Notes() for _ in range(LINES_PER_SITE + 1)]
    for one in ends:
        places.bern.dial("genf", "data", one)
    await turns()
    assert [one.ended for one in ends[-2:]] == [[], ["too many lines are open"]]


async def test_messages_of_an_unknown_line_are_answered_with_an_end() -> None:
    """After a restart, the other site learns that its line is gone."""
    places = await Places().open()
    near, _ = await places.dialled()
    places.buses[1].on_arrival = Lines(places.buses[1])._arrived
    near.line.write(b"still there?")
    await turns()
    assert near.ended == ["the line is not open"]


async def test_short_and_foreign_messages_are_ignored() -> None:
    """Anything may arrive from the network."""
    places = await Places().open()
    for body in (b"", b"\x07", bytes(17), b"\x09" + bytes(16)):
        places.buses[0].send("genf", "control", body)
    await turns()
    assert len(places.accepted) == 1  # 17 zero bytes are the request for line 0
