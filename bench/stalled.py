"""Pages for `fanout_stall`: most read all data, some read nothing, and one reads slowly.

``python -m bench.stalled PORT PATH HEALTHY STOPPED BYTES_PER_S`` prints ``ready``. When standard
input closes, the program prints a JSON object. The object contains the number of frames with values
for each healthy page. The object also contains the times and ages of the slow page's frames, in
milliseconds of the monotonic clock.
"""

import json
import os
import selectors
import socket
import sys
import time

from bench.viewers import Viewer, head_and_body

PING, TEXT = 0x89, 0x81
CHUNK = 1 << 18
STEP_S = 0.01
RECEIVE_BYTES = 1 << 14
VALUES = b'{"t":"v",'


class Page(Viewer):
    """A page that parses WebSocket frames and answers pings."""

    def __init__(self, port: int, path: str) -> None:
        super().__init__(port, path, [])
        self.buffer = bytearray(self.rest)
        self.ages: list[tuple[float, float]] = []
        self.is_open = True

    def read(self, most: int, *, is_aged: bool = False) -> int:
        """Read at most `most` bytes; return the number of bytes read."""
        try:
            data = self.line.recv(most)
        except BlockingIOError:
            return 0
        except ConnectionError:
            data = b""
        self.is_open = bool(data)
        self.buffer += data
        while (frame := self._next()) is not None:
            kind, body = frame
            if kind == PING:
                self.line.send(bytes([0x8A, 0x80 | len(body)]) + bytes(4) + body)
            elif kind == TEXT and body.startswith(VALUES):
                self.messages += 1
                if is_aged:
                    now_ms = time.monotonic() * 1000
                    self.ages.append((now_ms, now_ms - json.loads(body)["n"]))
        return len(data)

    def _next(self) -> tuple[int, bytes] | None:
        size = head_and_body(bytes(self.buffer[:10]))
        if size is None or len(self.buffer) < size:
            return None
        wide = {126: 2, 127: 8}.get(self.buffer[1] & 0x7F, 0)
        frame = self.buffer[0], bytes(self.buffer[2 + wide : size])
        del self.buffer[:size]
        return frame


def main() -> None:
    """Read frames until standard input closes."""
    port, path = int(sys.argv[1]), sys.argv[2]
    healthy_count, stopped_count, rate = map(int, sys.argv[3:6])
    healthy = [Page(port, path) for _ in range(healthy_count)]
    stopped = [Page(port, path) for _ in range(stopped_count)]
    slow = Page(port, path)
    # The connection must be slow, so it needs a small receive buffer.
    slow.line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
    ready = selectors.DefaultSelector()
    for page in healthy:
        ready.register(page.line, selectors.EVENT_READ, page)
    ready.register(sys.stdin, selectors.EVENT_READ, None)
    print("ready", flush=True)
    last_s, allowed = time.monotonic(), 0.0
    while True:
        for key, _ in ready.select(STEP_S):
            if key.data is None:
                os.read(key.fd, 1)
                said = {"healthy": [page.messages for page in healthy], "slow": slow.ages}
                print(json.dumps(said))
                for page in stopped:
                    page.line.close()
                return
            if key.data.read(CHUNK) == 0 and not key.data.is_open:
                ready.unregister(key.fileobj)
        now_s = time.monotonic()
        allowed = min(allowed + (now_s - last_s) * rate, rate / 10)
        last_s = now_s
        if allowed >= 1 and slow.is_open:
            allowed -= slow.read(int(allowed), is_aged=True)


if __name__ == "__main__":
    main()
