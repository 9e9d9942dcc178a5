"""Robots in one process, a connection each: ``python fleet.py SIGNALS RATE_HZ``; prints its port.

A line has all signals of a robot, as JSON. Each value changes in each line.
"""

import asyncio
import contextlib
import json
import sys
import time
from itertools import cycle

LINES = 50
GOLDEN = 0.6180339887
"""Robots are out of step by this share of a period, so no two send at the same time."""


def lines(signals: int) -> list[bytes]:
    """Return the lines of a robot, for a cycle."""
    return [
        json.dumps(
            {f"s{each}": round((tick * 1.7 + each * 3.1) % 100, 1) for each in range(signals)},
            separators=(",", ":"),
        ).encode()
        + b"\n"
        for tick in range(LINES)
    ]


async def main() -> None:
    """Serve every client, as a robot of its own."""
    told, period_s = lines(int(sys.argv[1])), 1 / float(sys.argv[2])
    robots = 0

    async def tell(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal robots
        robots += 1
        due_s = time.monotonic() + robots * GOLDEN % 1 * period_s
        with contextlib.suppress(ConnectionError):
            for line in cycle(told):
                await asyncio.sleep(due_s - time.monotonic())
                writer.write(line)
                await writer.drain()
                due_s += period_s
                if writer.is_closing():
                    return

    server = await asyncio.start_server(tell, "127.0.0.1", 0)
    print("ready", server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
