"""An engine's process for the tests of the guard: a session that drives by itself.

``python guard_engine.py PORT [here]``. It obeys lines on standard input (``drive``, ``rest``,
``release``, ``stop``, ``big``, ``files``, ``backtrack``, ``end``, or a command), ticks every 50 ms
while it drives, and tells on standard output, with times of the monotonic clock in nanoseconds::

    guard PID           of the guard, whenever there is another one
    linked STATE        of the robot's line
    tick TIME           a tick was given to the movers
    stopped REASON TIME what the movers told
    files NUMBER        open descriptors of this process
    backtracked TIME TIME   from when to when a pattern has held up everything here
"""

import asyncio
import os
import re
import sys
import tempfile
import time
from pathlib import Path

from urc.config.load import load_profile
from urc.guard.pipe_channel import PipeChannel
from urc.motion.hold_to_run import HoldTerms
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Motion, Session

DOCUMENT = """\
urc: 1
kind: robot
name: cart
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
commands:
  drive:
    send: "go {{ v }}"
    args: { v: { min: -1000, max: 1000 } }
    hold: { repeat: 20ms, lease: 250ms, release: { v: 0 } }
  hello:
    send: "hello"
interfaces:
  default: { grid: hello, widgets: { hello: { use: button, bind: { press: hello } } } }
"""
PERIOD_S = 0.05
HELD_UP_NS = 600_000_000
BIG = 200_000
"""Bytes of a frame that no robot takes which has stopped reading."""


class Engine:
    """Drives one robot."""

    def __init__(self, session: Session) -> None:
        assert session.backend is not None
        self.backend = session.backend
        self.frames = session.frames
        self.session = session
        self.is_driving = False
        self.is_big = False
        self.speed = 0

    async def drive(self) -> None:
        """Tick for as long as it is to."""
        while True:
            if self.is_driving:
                self.speed = self.speed % 999 + 1
                data = b"go %d\n" % self.speed
                if self.is_big:
                    data = b"big %d %s\n" % (self.speed, b"x" * BIG)
                now_ns = time.monotonic_ns()
                self.backend.tick("drive", data)
                tell("tick", now_ns)
            await asyncio.sleep(PERIOD_S)

    async def report(self) -> None:
        """Tell what stopped."""
        while True:
            for _, reason in await self.backend.stops():
                tell("stopped", reason, time.monotonic_ns())
                if reason != "released":
                    self.is_driving = False

    async def watch(self) -> None:
        """Tell of the guard and the line."""
        guard, state = 0, ""
        while True:
            channel = self.backend.channel
            if isinstance(channel, PipeChannel) and channel.pid not in (0, guard):
                guard = channel.pid
                tell("guard", guard)
            now = self.session.hub.links["wire"].state if self.session.hub.links else ""
            if now != state:
                state = now
                tell("linked", state)
            await asyncio.sleep(0.005)

    async def obey(self, word: str) -> None:
        """Do as told."""
        if word in ("drive", "big"):
            self.is_driving, self.is_big = True, word == "big"
            self.backend.arm("drive", HoldTerms(self.frames.stop_frame("drive"), period_s=0.02))
        elif word == "rest":
            self.is_driving = False
        elif word == "release":
            self.is_driving = False
            self.backend.release("drive")
        elif word == "stop":
            self.is_driving = False
            self.backend.stop({"drive": self.frames.stop_frame("drive")})
        elif word == "files":
            tell("files", len(os.listdir("/proc/self/fd")))
        elif word == "backtrack":
            tell("backtracked", *backtrack())
            self.is_driving = False
        else:
            await self.session.command(word)


def backtrack() -> tuple[int, int]:
    """Match a pattern of which each letter more doubles the work, for longer than any lease."""
    began_ns = time.monotonic_ns()
    letters = 18
    while time.monotonic_ns() - began_ns < HELD_UP_NS:
        letters += 1
        re.match("^(a+)+$", "a" * letters + "!")
    return began_ns, time.monotonic_ns()


def tell(*words: object) -> None:
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


async def main(port: int, *, is_guarded: bool) -> None:
    catalog = built_in_catalog()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "cart.yaml")
        file.write_text(DOCUMENT.replace("PORT", str(port)), "utf-8")
        profile = load_profile(file, catalog)
    loop = asyncio.get_running_loop()
    orders = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(orders), sys.stdin)
    motion: Motion = "guarded" if is_guarded else "here"
    async with Session(profile, {}, catalog.transports, motion=motion) as session:
        engine = Engine(session)
        tasks = [loop.create_task(work()) for work in (engine.drive, engine.report, engine.watch)]
        while order := (await orders.readline()).decode().strip():
            if order == "end":
                break
            await engine.obey(order)
        tell("ending", time.monotonic_ns())
    tell("ended", time.monotonic_ns())
    for task in tasks:
        task.cancel()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), is_guarded="here" not in sys.argv))
