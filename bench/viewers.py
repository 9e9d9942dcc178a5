"""Pages that only watch: they open WebSockets, select channels, and count received data.

``python -m bench.viewers PORT PATH CLIENTS [SHOWN…]`` prints ``ready``. The client's number
replaces ``{}`` in PATH. The program prints a JSON list of each client's messages and bytes after
each line on standard input, and at the input's end. Frames are counted but not decoded, because
only the server is measured.
"""

import json
import os
import selectors
import socket
import sys

from urc.testing.entry import BEARER

HANDSHAKE = (
    "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
    "Origin: http://127.0.0.1:{port}\r\n"
    "Authorization: {key}\r\n"
    "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
KEY = os.environ.get("URC_BENCH_KEY")
"""Start key of the server; the default is the key of test servers."""
CHUNK = 1 << 18
OPEN_TIMEOUT_S = 10
PING = 9
"""Opcode of a ping, whose payload is short; a page that does not answer is disconnected."""


class Viewer:
    """One page."""

    def __init__(self, port: int, path: str, shown: list[str]) -> None:
        self.line = socket.create_connection(("127.0.0.1", port), OPEN_TIMEOUT_S)
        key = f"Bearer {KEY}" if KEY else BEARER["authorization"]
        self.line.sendall(HANDSHAKE.format(path=path, port=port, key=key).encode())
        head = b""
        while b"\r\n\r\n" not in head:
            head += self.line.recv(4096)
        head, _, self.rest = head.partition(b"\r\n\r\n")
        if b" 101 " not in head.split(b"\r\n", 1)[0]:
            raise SystemExit(f"no WebSocket: {head[:80]!r}")
        if shown:
            data = json.dumps({"t": "show", "signals": shown}).encode()
            # A mask of zeros is valid.
            self.line.sendall(bytes([0x81, 0x80 | len(data)]) + bytes(4) + data)
        self.line.setblocking(False)
        self.messages = 0
        self.bytes = 0
        self.skip = 0

    def take(self) -> bool:
        """Count the received frames; return whether the connection is still open."""
        data = self.line.recv(CHUNK)
        if not data:
            return False
        self.bytes += len(data)
        data = self.rest + data
        while len(data) > self.skip:
            data, self.skip = data[self.skip :], 0
            size = head_and_body(data)
            if size is None:
                break
            if data[0] & 0x0F == PING:
                if len(data) < size:
                    break
                self.line.send(bytes([0x8A, 0x80 | size - 2]) + bytes(4) + data[2:size])
            else:
                self.messages += 1
            self.skip = size
        else:
            self.skip -= len(data)
            data = b""
        self.rest = data
        return True


def head_and_body(data: bytes) -> int | None:
    """Return the first frame's length, or None if its header is incomplete."""
    if len(data) < 2:
        return None
    size = data[1] & 0x7F
    if size < 126:
        return 2 + size
    wide = 2 if size == 126 else 8
    if len(data) < 2 + wide:
        return None
    return 2 + wide + int.from_bytes(data[2 : 2 + wide])


def main() -> None:
    """Count frames until standard input closes."""
    port, path, count, *shown = sys.argv[1:]
    viewers = [Viewer(int(port), path.format(each), shown) for each in range(int(count))]
    ready = selectors.DefaultSelector()
    for viewer in viewers:
        ready.register(viewer.line, selectors.EVENT_READ, viewer)
    ready.register(sys.stdin, selectors.EVENT_READ, None)
    print("ready", flush=True)
    while True:
        for key, _ in ready.select():
            if key.data is None:
                order = os.read(key.fd, 64)
                counts = [[viewer.messages, viewer.bytes] for viewer in viewers]
                print(json.dumps(counts), flush=True)
                if not order:
                    return
            elif not key.data.take():
                ready.unregister(key.fileobj)


if __name__ == "__main__":
    main()
