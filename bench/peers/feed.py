"""A robot that says much: ``python feed.py KIND``; prints its port.

KIND is ``many`` (200 values 50 times a second in one line), or ``traces-60`` and ``traces-1000``:
ten values so often a second, and a scan of 1080 rays 20 times a second. Lines are JSON.
"""

import asyncio
import contextlib
import json
import math
import sys
import time

CHANNELS, CHANNELS_HZ = 200, 50
SERIES = 10
RAYS, SCANS_HZ = 1080, 20


def is_whole(channel: int) -> bool:
    """Return whether a value is a whole number, for widgets that show states."""
    return channel % 30 == 15


def channels(tick: int) -> dict[str, float]:
    """Return all values; each is another number in each tick, from 0 to 100."""
    values = [(tick * 1.7 + each * 3.1) % 100 for each in range(CHANNELS)]
    return {
        f"s{each}": round(value) if is_whole(each) else round(value, 1)
        for each, value in enumerate(values)
    }


def traces(tick: int, rate_hz: int) -> dict[str, float]:
    """Return a point of each trace, from -10 to 10."""
    time_s = tick / rate_hz
    return {
        f"p{each}": round(each - 4.5 + 5 * math.sin((1 + each / 5) * time_s + each), 3)
        for each in range(SERIES)
    }


def scan(tick: int) -> dict[str, list[float]]:
    """Return the distances of one sweep, up to 10 m."""
    return {
        "r": [round(5 + 3 * math.sin(ray / 40 + tick / 10), 2) for ray in range(RAYS)],
    }


async def every(rate_hz: int, writer: asyncio.StreamWriter, kind: str) -> None:
    """Tell lines of a kind at a rate, by a steady clock, until the other side is gone."""
    began_s = time.monotonic()
    tick = 0
    with contextlib.suppress(ConnectionError):
        while not writer.is_closing():
            # A timer is not exact to a millisecond: what is due by now goes together.
            due = int((time.monotonic() - began_s) * rate_hz)
            while tick <= due:
                values = {
                    "many": channels,
                    "traces": lambda number: traces(number, rate_hz),
                    "scan": scan,
                }[kind](tick)
                writer.write(json.dumps(values, separators=(",", ":")).encode("ascii") + b"\n")
                tick += 1
            await writer.drain()
            await asyncio.sleep(max(0.0, began_s + tick / rate_hz - time.monotonic()))


async def tell(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Tell one client all of the kind."""
    if sys.argv[1] == "many":
        await every(CHANNELS_HZ, writer, "many")
    else:
        await asyncio.gather(
            every(int(sys.argv[1].removeprefix("traces-")), writer, "traces"),
            every(SCANS_HZ, writer, "scan"),
        )


async def main() -> None:
    """Serve whoever comes."""
    server = await asyncio.start_server(tell, "127.0.0.1", 0)
    print("ready", server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
