"""A driver by hand for the robot of `bench.driver_robot`: what people write without URC.

It is tidy, and has what every driver of a real robot needs, as URC has:

- a speed is clamped, and what is no number is refused: `max` and `min` would make it full speed;
- readings are taken at any time, asked for or not, and the newest of every signal is kept; values
  that are out of range or no finite numbers are none, and lines that are none are counted;
- an answer is waited for with a time-out; one that comes too late is not taken for the next one's,
  and one that never comes does not shift all that follow;
- nothing grows without a bound: neither a line without an end, nor the requests that wait, nor what
  is to be written;
- when the line is lost, whoever waits is told at once.

What URC does beyond (states of the line, reconnecting, alarms, priorities) it does not.
"""

import asyncio
import time
from collections import deque
from math import isfinite

from urc.model.values import Sample

__all__ = ["StreamDriver"]

REPLY_S = 1.0
LATE_S = 2 * REPLY_S
"""After that an answer is not expected any more."""
MOST_WAITING = 256
MOST_LINE = 8192
MOST_UNSENT = 262_144


def read(line: bytes, now: float) -> list[Sample] | None:
    """Return the samples of a line, or None for what is none."""
    parts = line.split(b" ")
    kind = parts[0]
    if b"_" in line:
        return None  # Python alone would take it for part of a number
    try:
        if kind == b"BAT":
            volts, percent = float(parts[1]), int(parts[2])
            if 0 <= volts <= 60 and 0 <= percent <= 100:
                return [Sample("volts", volts, now), Sample("percent", percent, now)]
        elif kind == b"ODO":
            x, y, heading = float(parts[1]), float(parts[2]), float(parts[3])
            if isfinite(x + y + heading):
                return [
                    Sample("x", x, now),
                    Sample("y", y, now),
                    Sample("heading", heading, now),
                ]
        elif kind == b"IMU":
            ax, ay, az = float(parts[1]), float(parts[2]), float(parts[3])
            gx, gy, gz = float(parts[4]), float(parts[5]), float(parts[6])
            if isfinite(ax + ay + az + gx + gy + gz):
                return [
                    Sample("ax", ax, now),
                    Sample("ay", ay, now),
                    Sample("az", az, now),
                    Sample("gx", gx, now),
                    Sample("gy", gy, now),
                    Sample("gz", gz, now),
                ]
        elif kind == b"RNG":
            left, right = float(parts[1]), float(parts[2])
            if left >= 0 and right >= 0 and isfinite(left + right):
                return [Sample("left", left, now), Sample("right", right, now)]
        elif kind == b"OK":
            return [Sample("done", int(parts[1]), now)]
    except (IndexError, ValueError):
        pass
    return None


class _Robot:
    """What both drivers know of the robot, and who waits for it."""

    def __init__(self) -> None:
        self.latest: dict[str, Sample] = {}
        self.faults = 0
        self._waiting: deque[tuple[asyncio.Future[list[Sample]], float]] = deque()
        """Who waits for an odometry line, and since when."""
        self.done = asyncio.Event()

    def take(self, line: bytes, now: float) -> None:
        """Keep the readings of a line, answer whoever waits."""
        samples = read(line, now)
        if samples is None:
            self.faults += 1
            return
        latest = self.latest
        for sample in samples:
            latest[sample.signal] = sample
        if self._waiting and line.startswith(b"ODO "):
            self._answer(samples, now)
        elif line.startswith(b"OK "):
            self.done.set()

    def _answer(self, samples: list[Sample], now: float) -> None:
        while self._waiting:
            answer, since = self._waiting.popleft()
            if not answer.done():
                answer.set_result(samples)
                return
            if now - since < LATE_S:
                return  # it has timed out, and this is its answer

    def ask(self) -> asyncio.Future[list[Sample]]:
        """Return what will be the next odometry line that nobody else waits for."""
        if len(self._waiting) >= MOST_WAITING:
            raise ConnectionError("too many requests wait for their answers")
        answer: asyncio.Future[list[Sample]] = asyncio.get_running_loop().create_future()
        self._waiting.append((answer, time.monotonic()))
        return answer

    def lost(self) -> None:
        """Tell whoever waits that the line is gone."""
        while self._waiting:
            answer, _ = self._waiting.popleft()
            if not answer.done():
                answer.set_exception(ConnectionError("the robot is gone"))
        self.done.set()


def request(vx: float, wz: float) -> bytes:
    """Return the frame of a speed, clamped; raise `ValueError` when it is no number."""
    if not isfinite(vx + wz):
        raise ValueError("a speed must be a finite number")
    vx = max(-1.0, min(1.0, vx))
    wz = max(-2.0, min(2.0, wz))
    return f"VEL {vx * 1000:.1f} {wz * 57.3:.2f}\n".encode()


class StreamDriver:
    """On `StreamReader` and `StreamWriter`: what most people write, with a task that reads."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._robot = _Robot()
        self._reader = reader
        self._writer = writer
        self._task = asyncio.create_task(self._read())

    @classmethod
    async def connect(cls, port: int) -> "StreamDriver":
        """Connect to the robot."""
        return cls(*await asyncio.open_connection("127.0.0.1", port))

    @property
    def latest(self) -> dict[str, Sample]:
        """The newest reading of every signal."""
        return self._robot.latest

    @property
    def faults(self) -> int:
        """Lines that were none."""
        return self._robot.faults

    async def _read(self) -> None:
        """Keep the readings, answer whoever waits."""
        try:
            while True:
                try:
                    line = await self._reader.readline()
                except ValueError:  # too long; the reader has dropped it
                    self._robot.faults += 1
                    continue
                if not line:
                    return
                self._robot.take(line[:-1], time.monotonic())
        except ConnectionError:
            pass
        finally:
            self._robot.lost()

    async def drive(self, vx: float, wz: float) -> dict[str, object]:
        """Send a speed, return what the robot answers."""
        self._writer.write(request(vx, wz))
        answer = self._robot.ask()
        async with asyncio.timeout(REPLY_S):
            await self._writer.drain()
            samples = await answer
        return {sample.signal: sample.value for sample in samples}

    async def flood(self, count: int) -> None:
        """Ask for `count` lines, and return when all have come."""
        self._robot.done.clear()
        self._writer.write(b"FLOOD %d\n" % count)
        async with asyncio.timeout(60):
            await self._writer.drain()
            await self._robot.done.wait()

    async def close(self) -> None:
        """Hang up."""
        self._task.cancel()
        self._writer.close()
