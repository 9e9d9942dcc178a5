"""Operators at pages that vanish in several ways: a separate program without imports from URC.

The program reads plans from standard input, one JSON object on each line, and forks a process for
each plan. The process acts like a page: it takes control, sends a tick every 50 ms, and vanishes as
planned. For each event, the process prints one line; times are from the monotonic clock, in
nanoseconds::

    pid NUMBER PID          the process of plan NUMBER
    port NUMBER PORT        its source port, for cuts by a relay
    reset NUMBER TIME       it resets STOP now
    driving NUMBER TIME     the first tick was sent
    dying NUMBER TIME TEXT  it vanishes now; TEXT is the server's last refusal, if any
    failed NUMBER TEXT      it could not drive
    ended NUMBER TIME       it was killed by order, a plan ``{"kill": NUMBER}``

The value of every tick is its send time in microseconds, so a robot can compute the tick's age.
When its standard input closes, the program kills every forked process and ends.
"""

import base64
import contextlib
import ctypes
import json
import os
import select
import signal
import socket
import struct
import sys
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

TICK_NS = 50_000_000
FLOOD_NS = 1_000_000
ANSWER_S = 20.0
_PR_SET_PDEATHSIG = 1
FLOOD = 400
"""Number of messages in one burst, enough to make a server disconnect the page."""


class Plan(NamedTuple):
    """The plan for one page."""

    number: int
    host: str
    port: int
    robot: str
    death: str
    """How the page vanishes: ``close``, ``kill``, ``freeze``, ``block``, ``reset`` or ``kick``.

    With ``outside``, the page keeps driving while another program cuts the link. With ``flood``,
    the page sends a thousand ticks a second.
    """
    drive_s: float
    """Driving time before the page vanishes, in seconds."""
    life_s: float = 120.0
    """Longest run time of the page's process, in seconds."""
    command: str = "go"
    argument: str = "t"
    key: str = ""
    """The server's start key, or a token; "" for neither."""
    cookie: str = ""
    """Cookie from a sign-in, ``name=secret``; "" for no cookie."""
    has_spare: bool = False
    """Whether the page also sends held controls on a second connection."""
    verb: str = "take"
    """How the page asks for the controls: ``take``, or ``force`` to take them from another."""
    resets: bool = True
    """Whether the page resets STOP before it drives; otherwise it waits."""
    mark: int | None = None
    """Last digit of each value, in base 16; it tells apart pages that drive the same robot."""


class Page:
    """A WebSocket client that acts like a page of the dashboard."""

    def __init__(self, plan: Plan, path: str = "/ws") -> None:
        self.plan = plan
        self.path = path
        self.key = ""
        self.spare: Page | None = None
        self.epoch = -1
        self.heartbeat = -1
        self.you = ""
        self.is_mine = False
        self.is_latched = False
        self.stops = 0
        """Number of STOPs until now, which a reset has to name."""
        self.is_live = False
        """Whether the robot is connected.

        Without a connection, the page's controls are disabled.
        """
        self.holder = ""
        self.refusal = ""
        self.has_let_go = False
        self.is_closed = False
        self.sent = 0
        self._rest = b""
        self.socket = socket.create_connection((plan.host, plan.port), ANSWER_S)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._shake_hands()

    def _shake_hands(self) -> None:
        plan = self.plan
        place = f"{plan.host}:{plan.port}"
        key = base64.b64encode(os.urandom(16)).decode()
        head = (
            f"GET {self.path}?robot={plan.robot} HTTP/1.1\r\nHost: {place}\r\nOrigin: http://{place}\r\n"
            "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Key: {key}\r\n"
        )
        head += f"Authorization: Bearer {plan.key}\r\n" if plan.key else ""
        head += f"Cookie: {plan.cookie}\r\n\r\n" if plan.cookie else "\r\n"
        self.socket.sendall(head.encode())
        answer = b""
        while b"\r\n\r\n" not in answer:
            data = self.socket.recv(65536)
            if not data:
                raise ConnectionError("the server closed the connection")
            answer += data
        first, self._rest = answer.split(b"\r\n\r\n", 1)
        if b" 101 " not in first.split(b"\r\n")[0]:
            raise ConnectionError(first.split(b"\r\n")[0].decode("latin-1"))
        self.socket.setblocking(False)
        self._sort()  # the first messages may have arrived with the handshake

    def say(self, message: dict[str, Any]) -> bool:
        """Send a message if the socket accepts it immediately; return whether it was sent."""
        return self._frame(1, json.dumps(message).encode())

    def close(self) -> None:
        """Send a close message and disconnect, like a closed browser tab."""
        self._frame(8, struct.pack("!H", 1001))
        self.socket.close()

    def _frame(self, kind: int, data: bytes) -> bool:
        mask = os.urandom(4)
        size = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + struct.pack(
            "!H", len(data)
        )  # fmt: skip
        masked = bytes(byte ^ mask[place % 4] for place, byte in enumerate(data))
        try:
            self.socket.sendall(bytes([0x80 | kind]) + size + mask + masked)
        except BlockingIOError:
            return False
        except OSError:
            self.is_closed = True
            return False
        return True

    def wait(self, until_ns: int) -> None:
        """Handle messages from the server until the time `until_ns`."""
        while not self.is_closed:
            left_s = (until_ns - time.monotonic_ns()) / 1e9
            lines = [one for one in (self, self.spare) if one is not None and not one.is_closed]
            ready = select.select([one.socket for one in lines], [], [], max(0.0, left_s))[0]
            if left_s <= 0 or not ready:
                return
            for one in lines:
                if one.socket in ready:
                    one.hear()
                    self.heartbeat = max(self.heartbeat, one.heartbeat)
        time.sleep(max(0.0, (until_ns - time.monotonic_ns()) / 1e9))

    def hear(self) -> None:
        """Handle received messages."""
        try:
            data = self.socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.is_closed = True
            return
        self._rest += data
        self._sort()

    def _sort(self) -> None:
        while (cut := _frame_of(self._rest)) is not None:
            kind, body, self._rest = cut
            if kind == 1:
                self._take(json.loads(body))
            elif kind == 8:
                self.is_closed = True
            elif kind == 9:
                self._frame(10, body)

    def _take(self, message: dict[str, Any]) -> None:
        kind = message.get("t")
        if kind == "lease":
            holder = message.get("holder") or {}
            self.you, self.epoch = message["you"], message["epoch"]
            self.holder = holder.get("id", "")
            self.key = message["spare"]
            self.is_mine = bool(self.you) and self.holder == self.you
            self.is_latched = bool(message.get("latched"))
            self.stops = message["stops"]
        elif kind == "links":
            self.is_live = all(one["state"] == "live" for one in message["links"])
        elif kind == "beat":
            self.heartbeat = message["n"]
        elif kind in ("refused", "error"):
            self.refusal = message.get("message", "")

    def tick(self) -> int:
        """Send the time in microseconds as a sample of the held control; return this time."""
        self.sent += 1
        value = time.monotonic_ns() // 1000
        if self.plan.mark is not None:
            value += self.plan.mark - value % 16
        self._say_twice(
            {
                "t": "tick",
                "command": self.plan.command,
                "epoch": self.epoch,
                "number": self.sent,
                "echo": self.heartbeat,
                "arguments": {self.plan.argument: value},
            }
        )
        return value

    def _say_twice(self, message: dict[str, Any]) -> None:
        self.say(message)
        if self.spare is not None:
            self.spare.say(message)

    def double(self) -> None:
        """Open the second connection for held controls."""
        self.spare = Page(self.plan, "/ws/spare")
        self.spare.say({"t": "spare", "key": self.key})

    def let_go(self) -> None:
        """Release all controls."""
        self.has_let_go = True
        self.sent += 1
        message = {"t": "release", "command": self.plan.command, "number": self.sent}
        self._say_twice(message)

    def take_controls(self) -> None:
        """Wait until the page has the lease and a heartbeat, and the robot is connected.

        Raise `TimeoutError` at the time limit.
        """
        until_ns = time.monotonic_ns() + int(ANSWER_S * 1e9)
        asked_ns = 0
        while not (self.is_mine and self.is_live and self.heartbeat >= 0):
            now_ns = time.monotonic_ns()
            if now_ns > until_ns or self.is_closed:
                state = f"live {self.is_live}, mine {self.is_mine}, beat {self.heartbeat}"
                raise TimeoutError(f"no controls ({state}): {self.refusal or 'no answer'}")
            # The previous operator is leaving, so repeat the request until the controls are free.
            if self.you and not self.is_mine and now_ns - asked_ns > TICK_NS:
                self._ask()
                asked_ns = now_ns
            self.wait(now_ns + TICK_NS // 5)

    def _ask(self) -> None:
        if not self.is_latched:
            self.say({"t": "drive", "verb": self.plan.verb})
        elif self.plan.resets:
            tell("reset", self.plan.number, time.monotonic_ns())
            self.say({"t": "drive", "verb": "reset", "stops": self.stops})


def _frame_of(data: bytes) -> tuple[int, bytes, bytes] | None:
    """Return the first frame's opcode and payload and the remaining data; None if incomplete."""
    if len(data) < 2:
        return None
    head, size = 2, data[1] & 0x7F
    if size >= 126:
        wide = 2 if size == 126 else 8
        head += wide
        if len(data) < head:
            return None
        size = int.from_bytes(data[2:head], "big")
    if len(data) < head + size:
        return None
    return data[0] & 0x0F, data[head : head + size], data[head + size :]


def tell(*words: object) -> None:
    """Write one line with a single system call, because the processes share the pipe."""
    os.write(1, (" ".join(map(str, words)) + "\n").encode())


def live(plan: Plan) -> None:
    """Act as one page until the page vanishes."""
    page = Page(plan)
    signal.signal(signal.SIGUSR1, lambda *_: page.let_go())
    tell("port", plan.number, page.socket.getsockname()[1])
    page.take_controls()
    if plan.has_spare:
        page.double()
    began_ns = time.monotonic_ns()
    tell("driving", plan.number, began_ns)
    _drive(page, began_ns, began_ns + int(plan.drive_s * 1e9))
    tell("dying", plan.number, time.monotonic_ns(), page.refusal)
    _die(page, plan)


@contextlib.contextmanager
def _no_release_meanwhile() -> Iterator[None]:
    """Postpone an order to release, so that the release does not overtake an earlier tick."""
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGUSR1])


def _drive(page: Page, next_ns: int, until_ns: int, every_ns: int = TICK_NS) -> None:
    """Send ticks at a fixed rate until the time `until_ns`, or until the server is gone."""
    while next_ns < until_ns and not page.is_closed:
        page.wait(next_ns)
        with _no_release_meanwhile():
            if not page.has_let_go:
                page.tick()
        next_ns += every_ns
    page.wait(until_ns)


def _die(page: Page, plan: Plan) -> None:
    end_ns, death = time.monotonic_ns() + int(plan.life_s * 1e9), plan.death
    if death == "close":
        page.close()
    elif death == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif death == "freeze":
        os.kill(os.getpid(), signal.SIGSTOP)
    elif death == "reset":
        page.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        page.socket.close()
    elif death == "kick":
        for _ in range(FLOOD):
            page.say({"t": "ping", "c": 0})
        page.wait(end_ns)
    elif death == "block":
        page.wait(end_ns)  # the socket lives, but the page's thread samples nothing
    else:
        every_ns = FLOOD_NS if death == "flood" else TICK_NS
        _drive(page, time.monotonic_ns(), end_ns, every_ns)


def start(plan: Plan) -> int:
    """Fork a process for a plan; return its id."""
    child = os.fork()
    if child:
        tell("pid", plan.number, child)
        return child
    try:
        _end_with_parent()
        os.close(0)
        live(plan)
    except Exception as error:
        tell("failed", plan.number, f"{type(error).__name__}: {error}")
    finally:
        os._exit(0)


def _end_with_parent() -> None:
    """Make the kernel kill this process when its parent ends; a frozen process can't end itself."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _reap(children: dict[int, int]) -> None:
    """Remove ended processes from the list, because their ids may soon be reused."""
    for number, child in list(children.items()):
        if os.waitpid(child, os.WNOHANG)[0]:
            del children[number]


def _kill(children: dict[int, int], number: int) -> None:
    child = children.pop(number, None)
    if child is not None:
        os.kill(child, signal.SIGKILL)  # not reaped before, so the id is still valid
        os.waitpid(child, 0)
    tell("ended", number, time.monotonic_ns())


def main() -> None:
    """Fork a page for every plan until standard input closes; ``{"kill": NUMBER}`` ends a page.

    After ``{"let_go": NUMBER}``, a page releases its controls and continues to run.
    """
    children: dict[int, int] = {}
    try:
        for line in sys.stdin:
            order = json.loads(line)
            _reap(children)
            if "kill" in order:
                _kill(children, order["kill"])
            elif "let_go" in order:
                os.kill(children[order["let_go"]], signal.SIGUSR1)
            else:
                plan = Plan(**order)
                children[plan.number] = start(plan)
    finally:
        _reap(children)
        for number in list(children):
            _kill(children, number)


if __name__ == "__main__":
    main()
