"""A camera, and a line with a limited rate: a program of its own, so that it delays no measurement.

    python picture_source.py OWN CONTROL

The camera sends motion JPEG over HTTP: `IMAGE_BYTES` per image, `RATE_HZ` images a second. The line
passes connections on, from the port OWN to the port CONTROL without a limit. From the next port to
the next port, the limit is `LINE_BYTES_S` in each direction. The program prints ``ready`` and the
port of the camera. It ends when its standard input closes.
"""

import asyncio
import sys
from asyncio import StreamReader, StreamWriter
from contextlib import suppress
from functools import partial

IMAGE_BYTES = 25_000
RATE_HZ = 10
LINE_BYTES_S = 500_000
READ_BYTES = 4096
KEPT_BYTES = 64 * 1024
IMAGE = b"\xff\xd8\xff\xe0" + bytes(IMAGE_BYTES - 6) + b"\xff\xd9"
HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=x\r\n\r\n"
PART = b"--x\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n%b\r\n"


async def film(reader: StreamReader, writer: StreamWriter) -> None:
    """Send images until the client ends."""
    with suppress(OSError):
        await reader.readuntil(b"\r\n\r\n")
        writer.write(HEAD)
        due_s = asyncio.get_running_loop().time()
        while True:
            writer.write(PART % (IMAGE_BYTES, IMAGE))
            await writer.drain()
            due_s += 1 / RATE_HZ
            await asyncio.sleep(due_s - asyncio.get_running_loop().time())


async def pump(reader: StreamReader, writer: StreamWriter, rate: float) -> None:
    """Copy bytes at a limited rate, in bytes a second, until either end closes."""
    clock = asyncio.get_running_loop().time
    free_s = clock()
    with suppress(OSError):
        while data := await reader.read(READ_BYTES):
            free_s = max(free_s, clock()) + len(data) / rate
            writer.write(data)
            await writer.drain()
            await asyncio.sleep(free_s - clock())
    writer.close()


async def passes(port: int, rate: float, reader: StreamReader, writer: StreamWriter) -> None:
    """Connect to a port, and copy both directions."""
    far_reader, far_writer = await asyncio.open_connection("127.0.0.1", port, limit=KEPT_BYTES)
    await asyncio.gather(pump(reader, far_writer, rate), pump(far_reader, writer, rate))


async def main() -> None:
    """Serve until standard input closes."""
    own, control = map(int, sys.argv[1:3])
    camera = await asyncio.start_server(film, "127.0.0.1", 0)
    rates = ((own, control, float("inf")), (own + 1, control + 1, float(LINE_BYTES_S)))
    for port, behind, rate in rates:
        await asyncio.start_server(
            partial(passes, behind, rate), "127.0.0.1", port, limit=KEPT_BYTES
        )
    print("ready", camera.sockets[0].getsockname()[1], flush=True)
    await asyncio.to_thread(sys.stdin.read)


if __name__ == "__main__":
    asyncio.run(main())
