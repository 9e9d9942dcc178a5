"""Servers behind ``rfc2217://`` that are none."""

import asyncio

import pytest

from tests.e2e.transports.hostile import bounded, liar, turn_deaf
from tests.e2e.transports.leaks import nothing_left
from urc.transports.base import ConnectFailed, TransportSetup
from urc.transports.serial import from_setup

pytestmark = pytest.mark.anyio


async def refusal(said: bytes, *, is_deaf: bool, most_bytes: int) -> str:
    """Open a port whose server says the same for ever; return why that failed."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if is_deaf:
            turn_deaf(writer)
        else:
            listening = asyncio.create_task(reader.read(2**31))
        while True:
            writer.write(said)
            await writer.drain()
            if not is_deaf and listening.done():
                return

    async with liar(talk, window=16384) as port, nothing_left():
        transport = from_setup(TransportSetup("wire", {"port": f"rfc2217://127.0.0.1:{port}"}))
        with bounded(most_bytes), pytest.raises(ConnectFailed) as raised:
            await transport.open(1.0)
        await transport.close()
        text = str(raised.value)
        del transport, raised
    assert text.isprintable()
    return text


async def test_order_without_its_values_is_told() -> None:
    """A notification of the pins that says nothing of the pins."""
    text = await refusal(b"\xff\xfa\x2c\x6b\xff\xf0" * 100, is_deaf=False, most_bytes=10_000_000)
    assert "does not speak rfc 2217" in text


@pytest.mark.parametrize("is_deaf", [False, True])
@pytest.mark.parametrize(
    "storm",
    [b"\xff\xfd\x05" * 10_000, b"\xff\xfb\x2c" * 10_000, b"\xff\xfa\x2c" + b"x" * 60_000],
    ids=["asks", "offers", "endless"],
)
async def test_options_without_end_are_not_kept(storm: bytes, is_deaf: bool) -> None:
    """Opening has its bound, and what came meanwhile is gone."""
    assert await refusal(storm, is_deaf=is_deaf, most_bytes=16_000_000)
