"""A camera with two streams: the low one comes on request, and its failures end nothing."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from urc.model.payload import Envelope, Payload
from urc.testing.clock import settle
from urc.transports import camera_streams
from urc.transports.base import LOW_STREAM, NOTICE, ConnectFailed, PeerClosed, TransportError
from urc.transports.camera_streams import TwoStreamCamera

pytestmark = pytest.mark.anyio


class Stream:
    """A transport to one stream."""

    def __init__(self, name: str) -> None:
        self.address = name
        self.is_open = False
        self.opened = 0
        self.fault = ""
        self.sent: list[Payload] = []
        self.units: asyncio.Queue[Payload | PeerClosed] = asyncio.Queue()

    async def open(self, timeout_s: float) -> None:
        self.opened += 1
        if self.fault:
            raise ConnectFailed(self.fault)
        self.is_open = True

    async def receive(self) -> Payload:
        found = await self.units.get()
        if isinstance(found, PeerClosed):
            raise found
        return found

    async def send(self, data: Payload) -> None:
        self.sent.append(data)

    async def close(self) -> None:
        self.is_open = False


class Camera:
    """A camera with two streams, open."""

    def __init__(self) -> None:
        self.main, self.low = Stream("main"), Stream("low")
        self.both = TwoStreamCamera(self.main, self.low)

    async def asks(self, verb: str, topic: str = LOW_STREAM) -> Envelope:
        envelope = Envelope(verb, {"topic": topic})
        await self.both.send(envelope)
        await settle()
        return envelope


@pytest.fixture
async def camera() -> AsyncIterator[Camera]:
    made = Camera()
    await made.both.open(1.0)
    yield made
    await made.both.close()


async def test_the_low_stream_is_opened_for_a_viewer_only(camera: Camera) -> None:
    camera.main.units.put_nowait(b"1")
    assert await camera.both.receive() == b"1"
    assert camera.low.opened == 0
    await camera.asks("subscribe")
    await camera.asks("subscribe")
    assert (camera.low.is_open, camera.low.opened) == (True, 1)
    camera.low.units.put_nowait(b"a")
    assert await camera.both.receive() == Envelope(LOW_STREAM, {}, b"a")
    await camera.asks("unsubscribe")
    assert not camera.low.is_open
    camera.main.units.put_nowait(b"2")
    assert await camera.both.receive() == b"2"


async def test_other_requests_go_to_the_main_stream(camera: Camera) -> None:
    pause = await camera.asks("unsubscribe", "")
    assert camera.main.sent == [pause]
    assert camera.both.address == "main"


async def test_a_failure_of_the_low_stream_is_a_note_and_it_is_tried_again(
    camera: Camera, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []

    async def wait(seconds: float) -> None:
        waits.append(seconds)

    monkeypatch.setattr(camera_streams.asyncio, "sleep", wait)
    camera.low.fault = "no route"
    await camera.both.send(Envelope("subscribe", {"topic": LOW_STREAM}))
    for _ in range(7):
        assert await camera.both.receive() == Envelope(NOTICE, {}, "low stream: no route")
    assert waits[:6] == [2.0, 4.0, 8.0, 16.0, 32.0, 60.0]
    camera.low.fault = ""
    camera.low.units.put_nowait(b"a")
    while (found := await camera.both.receive()) != Envelope(LOW_STREAM, {}, b"a"):
        assert isinstance(found, Envelope)


async def test_the_end_of_the_main_stream_is_the_end(camera: Camera) -> None:
    camera.main.units.put_nowait(PeerClosed("gone"))
    with pytest.raises(PeerClosed, match="gone"):
        await camera.both.receive()


async def test_a_reader_that_waits_hears_of_the_end(camera: Camera) -> None:
    await camera.asks("subscribe")
    reading = asyncio.create_task(camera.both.receive())
    await settle()
    await camera.both.close()
    with pytest.raises(PeerClosed):
        await reading
    assert not camera.main.is_open
    assert not camera.low.is_open
    with pytest.raises(PeerClosed):
        await camera.both.receive()
    await camera.asks("subscribe")
    assert camera.low.opened == 1, "a closed camera opens nothing"


async def test_it_may_be_opened_again(camera: Camera) -> None:
    await camera.both.close()
    await camera.both.open(1.0)
    camera.main.units.put_nowait(b"1")
    assert await camera.both.receive() == b"1"
    with pytest.raises(TransportError):
        await _refusing().open(1.0)


def _refusing() -> TwoStreamCamera:
    main = Stream("main")
    main.fault = "no route"
    return TwoStreamCamera(main, Stream("low"))
