"""Messages pass whole and in order; what waits is put in order by what it is worth."""

import asyncio
import socket

import msgspec
import pytest

from urc.guard.pipe import Pipe

pytestmark = pytest.mark.anyio

FULL = b"x" * 1_000_000
WITHIN_S = 10.0


class End:
    """One end of a pipe, whose messages are anything."""

    def __init__(self, line: socket.socket) -> None:
        self.got: list[object] = []
        self.sizes: list[int] = []
        self.is_gone = asyncio.Event()
        self.changed = asyncio.Event()
        self.settled = 0
        encoder, decoder = msgspec.msgpack.Encoder(), msgspec.msgpack.Decoder()
        self.pipe = Pipe(
            line, encoder, decoder, take=self.take, settle=self.settle, gone=self.is_gone.set
        )

    def take(self, message: object) -> None:
        self.got.append(message)
        self.sizes.append(self.pipe.taken_bytes)
        self.changed.set()

    def settle(self) -> None:
        self.settled += 1

    async def until(self, count: int) -> None:
        async with asyncio.timeout(WITHIN_S):
            while len(self.got) < count:
                self.changed.clear()
                await self.changed.wait()


@pytest.fixture
async def ends() -> tuple[End, End]:
    ours, theirs = socket.socketpair()
    return End(ours), End(theirs)


@pytest.fixture(autouse=True)
async def closing(ends: tuple[End, End]) -> object:
    yield
    for end in ends:
        end.pipe.close()


async def test_messages_pass_in_order(ends: tuple[End, End]) -> None:
    a, b = ends
    sizes = [a.pipe.post([number, "text", b"\x00" * number]) for number in range(300)]
    await b.until(300)
    assert b.got == [[number, "text", b"\x00" * number] for number in range(300)]
    assert b.sizes == sizes, "both sides count the same"
    assert b.settled < 300


async def test_large_messages_pass(ends: tuple[End, End]) -> None:
    a, b = ends
    for number in range(3):
        a.pipe.post([number, FULL])
    await b.until(3)
    assert b.got == [[number, FULL] for number in range(3)]


async def test_what_is_worth_most_goes_first(ends: tuple[End, End]) -> None:
    """Behind a message that fills the pipe: stops, then the rest, then the newest of each tick."""
    a, b = ends
    a.pipe.post(FULL)
    assert a.pipe.is_backed_up
    for number in range(50):
        a.pipe.post(["tick", number], slot="drive")
        a.pipe.post(["turn", number], slot="turn")
    a.pipe.post("dropped", slot="gone")
    a.pipe.drop("gone")
    a.pipe.post("request")
    a.pipe.post("stop", is_urgent=True)
    await b.until(5)
    assert b.got[1:] == ["stop", "request", ["tick", 49], ["turn", 49]]
    assert not a.pipe.is_backed_up


async def test_others_have_their_turn(ends: tuple[End, End]) -> None:
    """Many small messages do not hold the loop."""
    a, b = ends
    turns = 0

    async def count() -> None:
        nonlocal turns
        while True:
            turns += 1
            await asyncio.sleep(0)

    for number in range(2000):
        a.pipe.post(number)
    counting = asyncio.ensure_future(count())
    await b.until(2000)
    counting.cancel()
    assert b.got == list(range(2000))
    assert turns > 20


async def test_end_of_the_other_side_is_told_once(ends: tuple[End, End]) -> None:
    a, b = ends
    a.pipe.post("last")
    a.pipe.end()
    async with asyncio.timeout(WITHIN_S):
        await b.is_gone.wait()
    assert b.got == ["last"]
    assert not b.pipe.is_open
    assert b.pipe.post("nobody") > 0


async def test_unfit_message_breaks_nothing(ends: tuple[End, End]) -> None:
    a, b = ends
    with pytest.raises(TypeError):
        a.pipe.post(object())
    a.pipe.post("fine")
    await b.until(1)
    assert b.got == ["fine"]


async def test_pipe_that_broke_is_told_once_by_whatever_uses_it_next(
    ends: tuple[End, End],
) -> None:
    """Writing to a process that was killed; nothing is raised where nobody expects it."""
    a, b = ends
    a.pipe._loop.remove_reader(a.pipe._line)
    b.pipe.close()
    assert a.pipe.post("lost") > 0
    assert not a.is_gone.is_set(), "whoever posts is not called back from there"
    async with asyncio.timeout(WITHIN_S):
        await a.is_gone.wait()
    assert not a.pipe.is_open
    a.pipe.end()
    a.pipe.close()


async def test_reset_of_the_other_side_is_its_end(ends: tuple[End, End]) -> None:
    """What was written to it and never read makes the system say so."""
    a, b = ends
    b.pipe._loop.remove_reader(b.pipe._line)
    a.pipe.post("unread")
    b.pipe.close()
    async with asyncio.timeout(WITHIN_S):
        await a.is_gone.wait()
    assert a.got == []


async def test_reset_completes_no_message(ends: tuple[End, End]) -> None:
    """Of a message without its last byte nothing is taken."""
    a, b = ends
    b.pipe._loop.remove_reader(b.pipe._line)
    a.pipe.post("unread")
    message = (1).to_bytes(4, "little") + b"\x01"
    b.pipe._line.send(message[:-1])
    b.pipe.close()
    async with asyncio.timeout(WITHIN_S):
        await a.is_gone.wait()
    assert a.got == []
