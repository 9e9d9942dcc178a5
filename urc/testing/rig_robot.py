"""Robots that stamp every line they hear: a program of its own, which imports nothing of URC.

``python rig_robot.py tcp:127.0.0.1:0 udp:127.0.0.1:0 …`` is one robot for each argument. What they
hear is told on standard output, one line each, with times of the monotonic clock in nanoseconds::

    ready 40001 40002 …     their ports, once
    open ROBOT TIME         a connection was made
    line ROBOT TIME TEXT    a line was heard; TIME is that of its first byte
    gone ROBOT TIME         a connection ended
    late TIME MICROSECONDS  this program itself was not woken in time: the machine is busy

Ends when its standard input does, so that it never outlives whoever started it.
"""

import contextlib
import os
import selectors
import socket
import sys
import time
from dataclasses import dataclass

BEAT_NS = 5_000_000
"""How often it looks whether it is woken in time."""
LATE_NS = 5_000_000
"""Lateness that is worth a line."""
LONGEST_LINE = 65536


@dataclass
class Door:
    """Where one robot listens."""

    robot: int
    socket: socket.socket
    is_stream: bool


@dataclass
class Visit:
    """One connection."""

    robot: int
    socket: socket.socket
    rest: bytes = b""
    """Bytes of a line whose end has not come yet."""
    began_ns: int = 0
    """When its first byte came."""


def opened(place: str, robot: int) -> Door:
    """Listen at ``tcp:HOST:PORT`` or ``udp:HOST:PORT``."""
    kind, host, port = place.split(":")
    is_stream = kind == "tcp"
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM if is_stream else socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.bind((host, int(port)))
    if is_stream:
        made.listen(16)
    made.setblocking(False)
    return Door(robot, made, is_stream)


class Robots:
    """All robots of this program, in one loop."""

    def __init__(self, places: list[str]) -> None:
        self._selector = selectors.DefaultSelector()
        self._told: list[str] = []
        doors = [opened(place, robot) for robot, place in enumerate(places)]
        for door in doors:
            self._selector.register(door.socket, selectors.EVENT_READ, door)
        self._selector.register(0, selectors.EVENT_READ)
        self._tell("ready", *(door.socket.getsockname()[1] for door in doors))

    def run(self) -> None:
        """Listen until standard input ends."""
        due_ns = time.monotonic_ns() + BEAT_NS
        while True:
            self._flush()
            ready = self._selector.select(max(0.0, (due_ns - time.monotonic_ns()) / 1e9))
            now_ns = time.monotonic_ns()
            if now_ns - due_ns > LATE_NS:
                self._tell("late", now_ns, (now_ns - due_ns) // 1000)
            if now_ns >= due_ns:
                due_ns = now_ns + BEAT_NS
            for key, _ in ready:
                if key.fd == 0:
                    if not os.read(0, 4096):
                        return
                elif isinstance(key.data, Visit):
                    self._hear(key.data)
                else:
                    self._greet(key.data)

    def _greet(self, door: Door) -> None:
        if not door.is_stream:
            data = door.socket.recv(LONGEST_LINE)
            now_ns = time.monotonic_ns()
            for line in data.splitlines():
                self._tell("line", door.robot, now_ns, line.decode("latin-1"))
            return
        made, _ = door.socket.accept()
        made.setblocking(False)
        self._selector.register(made, selectors.EVENT_READ, Visit(door.robot, made))
        self._tell("open", door.robot, time.monotonic_ns())

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
        *lines, rest = data.split(b"\n")
        for line in lines:
            began_ns = visit.began_ns if visit.rest else now_ns
            text = (visit.rest + line).decode("latin-1").rstrip("\r")
            visit.rest = b""
            self._tell("line", visit.robot, began_ns, text)
        if rest:
            visit.began_ns = visit.began_ns if visit.rest else now_ns
            visit.rest = (visit.rest + rest)[-LONGEST_LINE:]

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
