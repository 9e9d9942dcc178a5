"""A WHEP server with the library aiortc: a stamped test card in H.264, encoded for each session.

    python whep_server.py PORT [--token TOKEN | --login USER:PASSWORD] [--codec CODEC]
                          [--candidates HOST] [--loss PERCENT] [--loss-again PERCENT]
                          [--wrong-hash] [--pair CERTIFICATE KEY] [--host ADDRESS]

The card has the stamp of tests/e2e/test_video_page.py: the number of the image in ten blocks.
``/front/whep`` is the stream, ``/moved/whep`` redirects to it, ``/away/whep`` to another host.
``GET /sessions`` returns the number of open sessions. This file runs in a process of its own.
"""

import argparse
import asyncio
import base64
import fractions
import logging
import random
import time

import av
import numpy as np
import uvicorn
from aiortc import (
    RTCConfiguration,
    RTCPeerConnection,
    RTCRtpSender,
    RTCSessionDescription,
    VideoStreamTrack,
)
from aiortc.rtp import is_rtcp
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

RATE = 30
BITS = 10
COLOURS = ((255, 0, 0), (0, 255, 0), (0, 0, 255))
SDP = "application/sdp"


def card(number: int) -> av.VideoFrame:
    """Return the card of 320 by 240 pixels: stamp, red, green, blue."""
    image = np.zeros((240, 320, 3), np.uint8)
    for bit in range(BITS):
        image[:80, 32 * bit : 32 * bit + 32] = 255 * (number >> bit & 1)
    for place, colour in enumerate(COLOURS):
        image[80:, 106 * place : 106 * place + 107] = colour
    return av.VideoFrame.from_ndarray(image, format="rgb24")


class Film(VideoStreamTrack):
    """The card, whose number counts the images since this server has started."""

    def __init__(self, began_s: float) -> None:
        super().__init__()
        self._began_s = began_s
        self._number = self._now()

    def _now(self) -> int:
        return int((time.monotonic() - self._began_s) * RATE)

    async def recv(self) -> av.VideoFrame:
        self._number = max(self._number + 1, self._now())
        await asyncio.sleep(self._began_s + self._number / RATE - time.monotonic())
        frame = card(self._number)
        frame.pts, frame.time_base = self._number * 90_000 // RATE, fractions.Fraction(1, 90_000)
        return frame


class Server:
    """The sessions, and what the command line asks for."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.began_s = time.monotonic()
        self.sessions: dict[str, RTCPeerConnection] = {}

    def refuses(self, request: Request) -> bool:
        wanted = ""
        if self.options.token:
            wanted = f"Bearer {self.options.token}"
        elif self.options.login:
            wanted = "Basic " + base64.b64encode(self.options.login.encode()).decode()
        return request.headers.get("authorization", "") != wanted

    async def offer(self, request: Request) -> Response:
        if self.refuses(request):
            return PlainTextResponse("no", 401)
        if request.headers.get("content-type") != SDP:
            return PlainTextResponse("SDP, please", 415)
        connection = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        offer = (await request.body()).decode()
        if self.options.codec:  # as a server that ignores what was offered
            offer = offer.replace("H264", self.options.codec)
        await connection.setRemoteDescription(RTCSessionDescription(offer, "offer"))
        sender = connection.addTrack(Film(self.began_s))
        self._lose(sender)
        await connection.setLocalDescription(await connection.createAnswer())
        text = connection.localDescription.sdp
        if self.options.codec:
            text = text.replace("H264", self.options.codec)
        if self.options.wrong_hash:
            text = "\r\n".join(self._wrong(line) for line in text.split("\r\n"))
        if self.options.candidates:
            text = "\r\n".join(self._elsewhere(line) for line in text.split("\r\n"))
        name = f"s{len(self.sessions)}-{random.getrandbits(32):08x}"
        self.sessions[name] = connection
        place = f"/front/whep/{name}"
        return Response(text, 201, {"Location": place}, media_type=SDP)

    def _wrong(self, line: str) -> str:
        is_hash = line.startswith("a=fingerprint:")
        return line[:-2] + ("00" if line[-2:] != "00" else "01") if is_hash else line

    def _elsewhere(self, line: str) -> str:
        parts = line.split(" ")
        if line.startswith("a=candidate:"):
            parts[4] = self.options.candidates
        return " ".join(parts)

    def _lose(self, sender: RTCRtpSender) -> None:
        """Lose some packets on the way, and some of those that are sent again."""
        send, chance = sender.transport._send_rtp, random.Random(7)  # noqa: S311
        seen: set[bytes] = set()

        async def send_most(data: bytes) -> None:
            number = data[2:4]
            percent = self.options.loss_again if number in seen else self.options.loss
            if is_rtcp(data) or chance.random() * 100 >= percent:
                await send(data)
            seen.add(number)

        if self.options.loss:
            sender.transport._send_rtp = send_most

    async def end(self, request: Request) -> Response:
        if self.refuses(request):
            return PlainTextResponse("no", 401)
        connection = self.sessions.pop(request.path_params["name"], None)
        if connection is None:
            return PlainTextResponse("no such session", 404)
        await connection.close()
        return Response(status_code=200)

    def app(self) -> Starlette:
        async def moved(_: Request) -> Response:
            return RedirectResponse("/front/whep", 307)

        async def away(_: Request) -> Response:
            return RedirectResponse("http://192.0.2.77/front/whep", 307)

        async def count(_: Request) -> Response:
            return PlainTextResponse(str(len(self.sessions)))

        return Starlette(
            routes=[
                Route("/front/whep", self.offer, methods=["POST"]),
                Route("/front/whep/{name}", self.end, methods=["DELETE"]),
                Route("/moved/whep", moved, methods=["POST"]),
                Route("/away/whep", away, methods=["POST"]),
                Route("/sessions", count),
            ]
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("port", type=int)
    parser.add_argument("--token")
    parser.add_argument("--login")
    parser.add_argument("--codec")
    parser.add_argument("--candidates")
    parser.add_argument("--wrong-hash", action="store_true")
    parser.add_argument("--pair", nargs=2, default=(None, None))
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--loss-again", type=float, default=0.0)
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    uvicorn.run(
        Server(options).app(),
        host=options.host,
        port=options.port,
        log_level="critical",
        ssl_certfile=options.pair[0],
        ssl_keyfile=options.pair[1],
    )


if __name__ == "__main__":
    main()
