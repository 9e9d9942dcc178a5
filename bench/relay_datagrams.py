"""A minimal relay from datagrams to WebSockets. See `video_relay`."""

import asyncio
import sys

from websockets.asyncio.server import ServerConnection, broadcast, serve


class Datagrams(asyncio.DatagramProtocol):
    """Sends each datagram to all pages."""

    def __init__(self, pages: set[ServerConnection]) -> None:
        self._pages = pages

    def datagram_received(self, data: bytes, addr: object) -> None:
        """Send a datagram on."""
        broadcast(self._pages, data)


async def main() -> None:
    pages: set[ServerConnection] = set()
    loop = asyncio.get_running_loop()
    for port in map(int, sys.argv[1:]):
        await loop.create_datagram_endpoint(
            lambda: Datagrams(pages), local_addr=("127.0.0.1", port)
        )

    async def join(page: ServerConnection) -> None:
        pages.add(page)
        await page.wait_closed()
        pages.discard(page)

    async with serve(join, "127.0.0.1", 0, compression=None, ping_interval=None) as server:
        print("ready", next(iter(server.sockets)).getsockname()[1], flush=True)
        await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
