"""Robots in one process, one for each connection: ``python fleet.py SIGNALS RATE_HZ``.

The program prints its port. Each line contains all of a robot's signals, as JSON. Every value
changes in every line. The program ends when its standard input closes.
"""

import asyncio
import contextlib
import json
import os
import sys
import threading
import time
from itertools import cycle

LINES = 50
GOLDEN = 0.6180339887
"""Phase shift between two robots, as a fraction of a period; no two robots send at the same
time."""


def lines(signals: int) -> list[bytes]:
    """Return the lines that a robot sends in a loop."""
    return [
        json.dumps(
            {f"s{each}": round((tick * 1.7 + each * 3.1) % 100, 1) for each in range(signals)},
            separators=(",", ":"),
        ).encode()
        + b"\n"
        for tick in range(LINES)
    ]


def end_with_input() -> None:
    """End the program when its standard input closes."""
    sys.stdin.read()
    os._exit(0)


async def main() -> None:
    """Serve every client as a separate robot."""
    threading.Thread(target=end_with_input, daemon=True).start()
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
