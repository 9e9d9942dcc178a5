"""A minimal Python relay that forwards WebSocket messages to the robot. See `motion_path`."""

import asyncio
import json
import sys

from websockets.asyncio.server import ServerConnection, serve


async def main() -> None:
    _, writer = await asyncio.open_connection("127.0.0.1", int(sys.argv[1]))

    async def relay(page: ServerConnection) -> None:
        async for text in page:
            said = json.loads(text)
            if "arguments" in said:  # a release has none
                writer.write(b"M %d\n" % said["arguments"]["value"])
                await writer.drain()

    async with serve(relay, "127.0.0.1", 0, compression=None, ping_interval=None) as server:
        print("ready", next(iter(server.sockets)).getsockname()[1], flush=True)
        await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
