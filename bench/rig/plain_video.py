"""A minimal video page: takes access units from an RTSP server, and a browser decodes them.

    python -m bench.rig.plain_video URL

Without engine, ages, limits and checks. PyAV reads the stream in a thread, each access unit goes to
the page over a WebSocket, and the page draws each image.
"""

import asyncio
import sys
import threading
from http import HTTPStatus

import av
from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

PAGE = b"""<!doctype html>
<style>canvas { position: fixed; width: 100vw; height: 100vh; object-fit: contain; }</style>
<canvas width="640" height="480"></canvas>
<script>
const pen = document.querySelector("canvas").getContext("2d");
const decoder = new VideoDecoder({
  output: (frame) => { pen.drawImage(frame, 0, 0); frame.close(); },
  error: (fault) => { throw fault; },
});
decoder.configure({ codec: "avc1.42c01f", optimizeForLatency: true });
const socket = new WebSocket(location.href.replace("http", "ws") + "video");
socket.binaryType = "arraybuffer";
let number = 0, hasKey = false;
socket.onmessage = ({ data }) => {
  const isKey = new Uint8Array(data)[0] === 1;
  hasKey ||= isKey;
  if (!hasKey) return;
  const type = isKey ? "key" : "delta";
  decoder.decode(new EncodedVideoChunk({ type, timestamp: (number += 1), data: data.slice(1) }));
};
</script>
"""
pages: set[ServerConnection] = set()


def answer(_: ServerConnection, request: Request) -> Response | None:
    """Return the page; None for its WebSocket."""
    if request.path != "/":
        return None
    head = Headers({"Content-Type": "text/html", "Content-Length": str(len(PAGE))})
    return Response(HTTPStatus.OK.value, HTTPStatus.OK.phrase, head, PAGE)


async def watch(page: ServerConnection) -> None:
    """Keep a page until it leaves."""
    pages.add(page)
    try:
        await page.wait_closed()
    finally:
        pages.discard(page)


def read(url: str, loop: asyncio.AbstractEventLoop) -> None:
    """Pass each access unit on."""
    options = {"rtsp_transport": "tcp", "fflags": "nobuffer", "max_delay": "0"}
    with av.open(url, options=options) as stream:
        for packet in stream.demux(video=0):
            unit = bytes([packet.is_keyframe]) + bytes(packet)
            loop.call_soon_threadsafe(broadcast, pages, unit)


async def main() -> None:
    """Serve until the standard input ends."""
    loop = asyncio.get_running_loop()
    async with serve(watch, "127.0.0.1", 0, process_request=answer, compression=None) as server:
        threading.Thread(target=read, args=(sys.argv[1], loop), daemon=True).start()
        print("ready", next(iter(server.sockets)).getsockname()[1], flush=True)
        await asyncio.to_thread(sys.stdin.read)


if __name__ == "__main__":
    asyncio.run(main())
