"""Robots that timestamp every received line: a separate program without imports from URC.

``python robot_process.py tcp:127.0.0.1:0 udp:127.0.0.1:0 …`` emulates one robot for each argument.
``ws`` is a WebSocket server; each message is a line. ``bridge`` implements the protocol of
rosbridge; ``{"data": NUMBER}`` on ``/go`` counts as the line ``M NUMBER``. ``http`` is an HTTP
server; a request for ``/go?t=NUMBER`` counts as the line ``M NUMBER``. ``mqtt:HOST:PORT``
subscribes to the topic ``go`` of a broker. The program prints one line for each event; times are
from the monotonic clock, in nanoseconds::

    ready 40001 40002 …     their ports, once
    open ROBOT TIME         a connection opened, or a broker accepted the subscription
    line ROBOT TIME TEXT    a line was received; TIME is that of its first byte
    gone ROBOT TIME         a connection ended
    late TIME MICROSECONDS  this program itself was woken late: the machine is busy
    waited TIME PID OF MICROSECONDS  another runnable process had to wait: the argument
                            ``pid:NUMBER`` watches the process OF and its children

The program ends when its standard input closes, so it ends with its parent.
"""

import base64
import contextlib
import hashlib
import json
import os
import selectors
import socket
import sys
import time
from dataclasses import dataclass

BEAT_NS = 5_000_000
"""Interval between checks for a late wake-up, in nanoseconds."""
LOOK_NS = 20_000_000
"""Interval between checks of how long processes have waited for a processor, in nanoseconds."""
WAITED_NS = 2_000_000
"""Shortest reported wait for a processor, in nanoseconds."""
LATE_NS = 5_000_000
"""Shortest reported delay of a wake-up, in nanoseconds."""
LONGEST_LINE = 65536
BROKER_S = 20.0
"""Timeout for starting a broker, in seconds."""
_GUID = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"


class Ear:
    """The decoder of one connection, which cuts received bytes into lines."""

    opening = b""
    """Bytes that the robot sends first on a new connection."""

    def __init__(self) -> None:
        self.rest = b""
        """Bytes of an incomplete line."""
        self.reply = b""
        """Reply to send."""
        self.is_ready = True
        """Whether the connection is ready for lines.

        Only a ready connection is reported as open.
        """

    def take(self, data: bytes) -> list[str]:
        """Return the lines completed by `data`."""
        *lines, rest = (self.rest + data).split(b"\n")
        self.rest = rest[-LONGEST_LINE:]
        return [line.decode("latin-1").rstrip("\r") for line in lines]


class WebEar(Ear):
    """A decoder of WebSocket messages."""

    def __init__(self) -> None:
        super().__init__()
        self.is_ready = False

    def take(self, data: bytes) -> list[str]:
        """Answer the handshake, then return each received message as a line."""
        self.rest += data
        if not self.is_ready:
            head, end, self.rest = self.rest.partition(b"\r\n\r\n")
            if not end:
                self.rest = head
                return []
            self.is_ready = True
            rows = (row.partition(b":") for row in head.split(b"\r\n"))
            key = next(value for name, _, value in rows if name.lower() == b"sec-websocket-key")
            proof = base64.b64encode(hashlib.sha1(key.strip() + _GUID).digest())  # noqa: S324
            self.reply += (
                b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                b"Connection: Upgrade\r\nSec-WebSocket-Accept: " + proof + b"\r\n\r\n"
            )
        found: list[str] = []
        while (frame := self._frame()) is not None:
            kind, body = frame
            if kind in (1, 2):
                found += self.read(body)
            elif kind == 9:
                self.reply += bytes([0x8A, len(body)]) + body
        return found

    def _frame(self) -> tuple[int, bytes] | None:
        """Remove and return the first complete frame, or return None."""
        data = self.rest
        if len(data) < 6:
            return None
        head, size = 2, data[1] & 0x7F
        if size == 126:
            head, size = 4, int.from_bytes(data[2:4], "big")
        end = head + 4 + size
        if len(data) < end:
            return None
        mask = data[head : head + 4]
        self.rest = data[end:]
        body = bytes(byte ^ mask[place % 4] for place, byte in enumerate(data[head + 4 : end]))
        return data[0] & 0x0F, body

    def read(self, body: bytes) -> list[str]:
        """Return the lines in a message."""
        return body.decode().splitlines()


class BridgeEar(WebEar):
    """A decoder of messages published through a rosbridge."""

    def read(self, body: bytes) -> list[str]:
        """Return a line for a message on the motion topic, and no line for other messages."""
        said = json.loads(body)
        is_motion = said["op"] == "publish" and said["topic"] == "/go"
        return [f"M {said['msg']['data']}"] if is_motion else []


class HttpEar(Ear):
    """A decoder of HTTP requests without a body, such as ``GET /go?t=5``."""

    def take(self, data: bytes) -> list[str]:
        """Return a line such as ``M 5`` for each complete request."""
        *heads, self.rest = (self.rest + data).split(b"\r\n\r\n")
        self.reply += b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok" * len(heads)
        return [f"M {head.split(b' ')[1].decode().rpartition('=')[2]}" for head in heads]


class BrokerEar(Ear):
    """An MQTT 3.1.1 subscriber."""

    opening = b"\x10\x0c\x00\x04MQTT\x04\x02\x00\x00\x00\x00"

    def __init__(self) -> None:
        super().__init__()
        self.is_ready = False

    def take(self, data: bytes) -> list[str]:
        """Subscribe after the login, then return published messages."""
        self.rest += data
        found: list[str] = []
        while len(self.rest) >= 2 and len(self.rest) >= 2 + self.rest[1]:
            kind, body = self.rest[0] >> 4, self.rest[2 : 2 + self.rest[1]]
            self.rest = self.rest[2 + len(body) :]
            if kind == 2:
                self.reply += b"\x82\x07\x00\x01\x00\x02go\x00"
            elif kind == 9:
                self.is_ready = True
            elif kind == 3:
                found.append(body[2 + int.from_bytes(body[:2], "big") :].decode())
        return found


EARS = {
    "tcp": Ear, "udp": Ear, "ws": WebEar, "bridge": BridgeEar, "http": HttpEar, "mqtt": BrokerEar,
}  # fmt: skip


@dataclass
class Door:
    """One robot's listening socket."""

    robot: int
    socket: socket.socket
    kind: str


@dataclass
class Visit:
    """One connection."""

    robot: int
    socket: socket.socket
    expectation: Ear
    began_ns: int = 0
    """Time at which the first byte of an incomplete line arrived."""
    is_told: bool = False


def opened(place: str, robot: int) -> Door | Visit:
    """Listen at an address ``KIND:HOST:PORT``, or connect to a broker at this address."""
    kind, host, port = place.split(":")
    if kind == "mqtt":
        line = dialled(host, int(port))
        line.sendall(BrokerEar.opening)
        line.setblocking(False)
        return Visit(robot, line, BrokerEar())
    is_stream = kind != "udp"
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM if is_stream else socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.bind((host, int(port)))
    if is_stream:
        made.listen(16)
    made.setblocking(False)
    return Door(robot, made, kind)


def dialled(host: str, port: int) -> socket.socket:
    """Connect to a server that may still be starting."""
    until_ns = time.monotonic_ns() + int(BROKER_S * 1e9)
    while True:
        try:
            return socket.create_connection((host, port), 1.0)
        except OSError:
            if time.monotonic_ns() > until_ns:
                raise
            time.sleep(0.05)


class Others:
    """A process and its children, with the time that each process waits for a processor."""

    def __init__(self, process: str) -> None:
        self.process = process
        self._everybody = [process]
        """The process and all children found so far, even after the process itself has ended."""
        self._waited: dict[str, int] = {}
        self._has_looked = False

    def look(self) -> list[tuple[str, int]]:
        """Return each wait for a processor since the last check: process id and nanoseconds."""
        found: list[tuple[str, int]] = []
        with (
            contextlib.suppress(OSError),  # the process has ended
            open(f"/proc/{self.process}/task/{self.process}/children") as children,
        ):
            new = (one for one in children.read().split() if one not in self._everybody)
            self._everybody.extend(new)
        for one in tuple(self._everybody):
            try:
                with open(f"/proc/{one}/schedstat") as counts:
                    waited = int(counts.read().split()[1])
            except OSError:  # it has ended
                self._everybody.remove(one)
                continue
            # A child that is new has waited since its start.
            more = waited - self._waited.get(one, 0 if self._has_looked else waited)
            self._waited[one] = waited
            if more > WAITED_NS:
                found.append((one, more))
        self._has_looked = True
        return found


class Robots:
    """The event loop with all robots of this program."""

    def __init__(self, places: list[str]) -> None:
        self._selector = selectors.DefaultSelector()
        self._told: list[str] = []
        self._others = [Others(place[4:]) for place in places if place.startswith("pid:")]
        places = [place for place in places if not place.startswith("pid:")]
        made = [opened(place, robot) for robot, place in enumerate(places)]
        for one in made:
            self._selector.register(one.socket, selectors.EVENT_READ, one)
        self._selector.register(0, selectors.EVENT_READ)
        ports = (one.socket.getsockname()[1] for one in made)
        self._tell("ready", *ports)

    def run(self) -> None:
        """Run the robots until standard input closes."""
        look_ns = due_ns = time.monotonic_ns() + BEAT_NS
        while True:
            self._flush()
            ready = self._selector.select(max(0.0, (due_ns - time.monotonic_ns()) / 1e9))
            now_ns = time.monotonic_ns()
            if now_ns - due_ns > LATE_NS:
                self._tell("late", now_ns, (now_ns - due_ns) // 1000)
            if now_ns >= due_ns:
                due_ns = now_ns + BEAT_NS
            if now_ns >= look_ns:
                look_ns = now_ns + LOOK_NS
                for other in self._others:
                    for process, waited_ns in other.look():
                        self._tell("waited", now_ns, process, other.process, waited_ns // 1000)
            for key, _ in ready:
                if key.fd == 0:
                    if not os.read(0, 4096):
                        return
                elif isinstance(key.data, Visit):
                    self._hear(key.data)
                else:
                    self._greet(key.data)

    def _greet(self, door: Door) -> None:
        if door.kind == "udp":
            data = door.socket.recv(LONGEST_LINE)
            now_ns = time.monotonic_ns()
            for line in data.splitlines():
                self._tell("line", door.robot, now_ns, line.decode("latin-1"))
            return
        made, _ = door.socket.accept()
        made.setblocking(False)
        visit = Visit(door.robot, made, EARS[door.kind]())
        self._selector.register(made, selectors.EVENT_READ, visit)
        self._look(visit, time.monotonic_ns())

    def _hear(self, visit: Visit) -> None:
        try:
            data = visit.socket.recv(LONGEST_LINE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        now_ns = time.monotonic_ns()
        if not data:
            self._selector.unregister(visit.socket)
            visit.socket.close()
            self._tell("gone", visit.robot, now_ns)
            return
        expectation = visit.expectation
        began_ns = visit.began_ns if expectation.rest else now_ns
        for text in expectation.take(data):
            self._tell("line", visit.robot, began_ns, text)
            began_ns = now_ns
        visit.began_ns = began_ns
        if expectation.reply:
            with contextlib.suppress(OSError):  # disconnected; the next check reports it
                visit.socket.sendall(expectation.reply)
            expectation.reply = b""
        self._look(visit, now_ns)

    def _look(self, visit: Visit, now_ns: int) -> None:
        """Report once that a connection is ready for lines."""
        if visit.expectation.is_ready and not visit.is_told:
            visit.is_told = True
            self._tell("open", visit.robot, now_ns)

    def _tell(self, *words: object) -> None:
        self._told.append(" ".join(map(str, words)) + "\n")

    def _flush(self) -> None:
        if self._told:
            sys.stdout.write("".join(self._told))
            sys.stdout.flush()
            self._told.clear()


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        Robots(sys.argv[1:]).run()
