"""A robot that says what time it is: ``python robot.py RATE_HZ``; prints its port.

Each line is the machine's monotonic clock in tenths of milliseconds, modulo `MODULUS` and `START`
on top, so that it has ten digits and whoever shows it shows how old it is. At 50 lines a second
there are five phases between robot and display, a fifth of a frame apart; each line is moved by up
to half of that, the same way in each run, so that all phases come equally often.
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
    """Tell the time at the rate, by a steady clock, until the other side is gone."""
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
    """Serve whoever comes."""
    server = await asyncio.start_server(tell, "127.0.0.1", 0)
    print("ready", server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
