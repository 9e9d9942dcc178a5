"""A hand-written page for one robot: ``python plain.py ROBOT_PORT``.

The server immediately forwards each line from the robot to the page's WebSocket. The page shows the
line in its next frame.
"""

import asyncio
import http
import sys

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

PAGE = b"""<!doctype html><meta charset="utf-8"><title>plain</title><p id="value">-</p>
<script>
const value = document.getElementById("value");
let newest = "", isDue = false;
new WebSocket(`ws://${location.host}/ws`).onmessage = ({ data }) => {
  newest = data;
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => { isDue = false; value.textContent = newest; });
};
</script>"""


def page(_: ServerConnection, request: Request) -> Response | None:
    """Return the page for every request except a WebSocket handshake."""
    if request.path == "/ws":
        return None
    headers = Headers({"Content-Type": "text/html", "Content-Length": str(len(PAGE))})
    return Response(http.HTTPStatus.OK, "OK", headers, PAGE)


async def stay(line: ServerConnection) -> None:
    """Keep a page's WebSocket open until the page closes it."""
    await line.wait_closed()


async def main() -> None:
    """Relay indefinitely."""
    reader, _ = await asyncio.open_connection("127.0.0.1", int(sys.argv[1]))
    async with serve(stay, "127.0.0.1", 0, process_request=page, compression=None) as server:
        print("ready", next(iter(server.sockets)).getsockname()[1], flush=True)
        while line := await reader.readline():
            broadcast(server.connections, line.decode().strip())


if __name__ == "__main__":
    asyncio.run(main())
