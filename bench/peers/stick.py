"""The stick that somebody would write by hand for this one robot: ``python stick.py ROBOT_PORT``.

Each raw move of a pointer that is down goes to the robot as it comes; nobody asks who drives, for
how long it may, or who lets go.
"""

import asyncio
import http
import sys

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

PAGE = b"""<!doctype html><meta charset="utf-8"><title>stick</title>
<style>.joystick-pad { height: 80vh; background: silver; touch-action: none }</style>
<p data-who>You drive</p>
<div class="urc-cell"><div class="joystick-pad" data-phase="idle"></div></div>
<script>
const pad = document.querySelector(".joystick-pad");
const line = new WebSocket(`ws://${location.host}/ws`);
let startY = null;
pad.onpointerdown = (event) => { pad.setPointerCapture(event.pointerId); startY = event.clientY; };
pad.onpointerup = () => { startY = null; line.send(0); };
const move = (event) => { if (startY !== null) line.send(Math.round(startY - event.clientY)); };
pad.addEventListener("pointerrawupdate", move);
</script>"""


def page(_: ServerConnection, request: Request) -> Response | None:
    """Answer anything but the WebSocket with the page."""
    if request.path == "/ws":
        return None
    headers = Headers({"Content-Type": "text/html", "Content-Length": str(len(PAGE))})
    return Response(http.HTTPStatus.OK, "OK", headers, PAGE)


async def main() -> None:
    """Relay for ever."""
    _, writer = await asyncio.open_connection("127.0.0.1", int(sys.argv[1]))

    async def relay(line: ServerConnection) -> None:
        async for text in line:
            writer.write(b"M %d\n" % int(text))

    async with serve(relay, "127.0.0.1", 0, process_request=page, compression=None) as server:
        print("ready", next(iter(server.sockets)).getsockname()[1], flush=True)
        await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
