"""A relay in front of an RTSP camera that notes when each access unit is complete.

    python -m bench.rig.rtsp_tap CAMERA_PORT

The relay reads the RTP packets on the RTSP connection (RFC 2326, 10.12) and joins their NAL units
(RFC 6184, 5.6 to 5.8). A unit is complete with its last packet, which has the marker. The time is
taken before these bytes leave for the program. A line on standard input ends the relay. It then
prints the times in ns of the monotonic clock, keyed by the name from `named`.
"""

import asyncio
import json
import sys
import time
from collections.abc import Iterable
from hashlib import blake2b
from typing import Final

__all__ = ["Packets", "named"]

_MAGIC: Final = 0x24
_HEAD: Final = 4
_PICTURES: Final = range(1, 6)
"""H.264 NAL unit types that contain parts of a picture."""
_STAP_A, _FU_A = 24, 28
_MARKER: Final = 0x80


def named(nals: Iterable[bytes]) -> str:
    """Return the name of an access unit: a checksum of the NAL units with its picture."""
    parts = [one.rstrip(b"\0") for one in nals if one and one[0] & 0x1F in _PICTURES]
    return blake2b(b"\0\0\1".join(parts), digest_size=12).hexdigest()


class Packets:
    """Reads the bytes from the camera."""

    def __init__(self) -> None:
        self._rest = b""
        self._nals: list[bytes] = []
        self._fragments = b""
        self.times_ns: dict[str, int] = {}

    def take(self, data: bytes, now_ns: int) -> None:
        """Read the next bytes, which have arrived at `now_ns`."""
        self._rest += data
        while self._rest:
            if self._rest[0] != _MAGIC:  # an answer of RTSP
                start = self._rest.find(b"$\0")
                self._rest = self._rest[start:] if start > 0 else b""
                continue
            size = _HEAD + int.from_bytes(self._rest[2:_HEAD], "big")
            if len(self._rest) < max(size, _HEAD):
                return
            packet, self._rest = self._rest[:size], self._rest[size:]
            if packet[1] == 0:  # the channel of RTP; the next one has RTCP
                self._packet(packet[_HEAD:], now_ns)

    def _packet(self, packet: bytes, now_ns: int) -> None:
        body = packet[12 + 4 * (packet[0] & 0x0F) :]
        kind = body[0] & 0x1F
        if kind == _STAP_A:
            place = 1
            while place + 2 < len(body):
                size = int.from_bytes(body[place : place + 2], "big")
                self._nals.append(body[place + 2 : place + 2 + size])
                place += 2 + size
        elif kind == _FU_A:
            if body[1] & 0x80:
                self._fragments = bytes([body[0] & 0xE0 | body[1] & 0x1F])
            self._fragments += body[2:]
            if body[1] & 0x40:
                self._nals.append(self._fragments)
        else:
            self._nals.append(body)
        if packet[1] & _MARKER:
            self.times_ns[named(self._nals)] = now_ns
            self._nals.clear()


async def main() -> None:
    """Relay until a line comes."""
    packets = Packets()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        camera_reader, camera_writer = await asyncio.open_connection("127.0.0.1", int(sys.argv[1]))

        async def out() -> None:
            while data := await reader.read(65536):
                camera_writer.write(data)
            camera_writer.close()

        asking = asyncio.create_task(out())
        while data := await camera_reader.read(65536):
            now_ns = time.monotonic_ns()
            writer.write(data)
            packets.take(data, now_ns)
        asking.cancel()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    print("ready", server.sockets[0].getsockname()[1], flush=True)
    await asyncio.to_thread(sys.stdin.readline)
    print("times", json.dumps(packets.times_ns).replace(" ", ""), flush=True)


if __name__ == "__main__":
    asyncio.run(main())
