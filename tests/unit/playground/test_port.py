"""The message port in place of a page's WebSocket."""

import asyncio
import json
from typing import Any

import pytest

from playground.port import PortSocket, frames
from urc.web.wire.picture import as_frame

pytestmark = pytest.mark.anyio


class Page:
    """The page's end of a port."""

    def __init__(self) -> None:
        self.got: list[Any] = []

    def text(self, data: str) -> None:
        self.got.append(data)

    def binary(self, data: bytes) -> None:
        self.got.append(data)

    def closed(self, code: int, reason: str) -> None:
        self.got.append((code, reason))


@pytest.mark.parametrize("size", [0, 125, 126, 65535, 65536, 200_000])
def test_frames_of_every_length_are_taken_apart(size: int) -> None:
    """One write may contain several frames."""
    text, data = b"t" * size, b"\0" * size
    joined = as_frame(text, is_text=True) + as_frame(data) + as_frame(b"end", is_text=True)
    assert [*frames(joined)] == [(True, text), (False, data), (True, b"end")]


async def test_messages_reach_the_sink_first_and_stay_in_order() -> None:
    """A refused message waits for `receive`, and all later messages wait behind it."""
    line, seen = PortSocket(Page()), []

    def sink(data: bytes) -> bool:
        seen.append(data)
        return data == b"tick"

    line.listen(sink)
    for text in ("tick", "run", "tick"):
        line.take(text)
    assert seen == [b"tick", b"run"]
    assert [(await line.receive())["text"] for _ in range(2)] == ["run", "tick"]


async def test_a_closed_socket_sends_nothing_more() -> None:
    """The page gets the code and the reason once, and the client sees a disconnect."""
    page = Page()
    line = PortSocket(page)
    await line.send_text(json.dumps(1))
    await line.close(4404, "no robot")
    await line.close()
    await line.send_text("late")
    line.write(as_frame(b"late"))
    line.abort()
    assert page.got == ["1", (4404, "no robot")]
    assert (await asyncio.wait_for(line.receive(), 1))["type"] == "websocket.disconnect"
