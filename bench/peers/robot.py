"""A robot that sends the time and prints its port: ``python robot.py RATE_HZ``.

Each line is the machine's monotonic clock in tenths of milliseconds, modulo `MODULUS`, plus
`START`. Each line has ten digits, from which the age of a shown line can be computed. At 50 lines a
second, the robot and the display have only five relative phases, a fifth of a frame apart. Each
line is therefore shifted by up to half of this interval, so that all phases are equally frequent.
The shifts are the same in every run.
"""

import asyncio
import contextlib
import sys
import time

MODULUS = 9 * 10**9
START = 10**9
MOVED_S = 1 / 60 / 5 / 2
GOLDEN = 0.6180339887


async def tell(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send the time at a fixed rate until the client disconnects."""
    period_s = 1 / float(sys.argv[1])
    began_s = time.monotonic()
    number = 0
    with contextlib.suppress(ConnectionError):
        while not writer.is_closing():
            writer.write(b"%d\n" % (START + int(time.monotonic() * 10_000) % MODULUS))
            await writer.drain()
            number += 1
            moved_s = (number * GOLDEN % 1 - 0.5) * 2 * MOVED_S
            due_s = began_s + number * period_s + moved_s
            await asyncio.sleep(max(0.0, due_s - time.monotonic()))


async def main() -> None:
    """Serve every client."""
    server = await asyncio.start_server(tell, "127.0.0.1", 0)
    print("ready", server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
