"""A robot that sends 200 values in one JSON line, 50 times a second, and prints its port."""

import asyncio
import contextlib
import json
import time

CHANNELS, CHANNELS_HZ = 200, 50


def is_whole(channel: int) -> bool:
    """Return whether the channel's values are integers, for a widget that shows states."""
    return channel % 30 == 15


def channels(tick: int) -> dict[str, float]:
    """Return the values of all channels, each from 0 to 100; every value changes in every tick."""
    values = [(tick * 1.7 + each * 3.1) % 100 for each in range(CHANNELS)]
    return {
        f"s{each}": round(value) if is_whole(each) else round(value, 1)
        for each, value in enumerate(values)
    }


async def tell(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send lines at a fixed rate until the client disconnects."""
    began_s = time.monotonic()
    tick = 0
    with contextlib.suppress(ConnectionError):
        while not writer.is_closing():
            # Timers are not accurate to the millisecond, so overdue lines are sent together.
            due = int((time.monotonic() - began_s) * CHANNELS_HZ)
            while tick <= due:
                values = json.dumps(channels(tick), separators=(",", ":"))
                writer.write(values.encode("ascii") + b"\n")
                tick += 1
            await writer.drain()
            await asyncio.sleep(max(0.0, began_s + tick / CHANNELS_HZ - time.monotonic()))


async def main() -> None:
    """Serve every client."""
    server = await asyncio.start_server(tell, "127.0.0.1", 0)
    print("ready", server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
