"""A typical hand-written driver for the robot of `bench.driver_robot`.

The code is tidy and, like URC, has the features that every driver for a real robot needs:

- A speed is clamped, and NaN is refused, because `max` and `min` would turn NaN into full speed.
- The robot may send readings at any time; the driver stores the newest reading of every signal.
  Out-of-range and non-finite values are dropped, and invalid lines are counted.
- A request has a timeout. A late reply is not assigned to the next request, and after a missing
  reply, later replies are still assigned correctly.
- Every buffer has a limit: unterminated lines, pending requests, and output.
- If the connection is lost, all pending requests fail immediately.

The driver lacks URC's other features, such as link states, reconnecting, alarms and priorities.
"""

import asyncio
import time
from collections import deque
from math import isfinite

from urc.model.values import Sample

__all__ = ["StreamDriver"]

REPLY_S = 1.0
LATE_S = 2 * REPLY_S
"""Time after which even a late reply to a request is no longer expected, in seconds."""
MOST_WAITING = 256
MOST_LINE = 8192
MOST_UNSENT = 262_144


def read(line: bytes, now: float) -> list[Sample] | None:
    """Return the samples in a line, or None for an invalid line."""
    parts = line.split(b" ")
    kind = parts[0]
    if b"_" in line:
        return None  # Python would accept it as part of a number
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
    """The newest readings from the robot, and the driver's pending requests."""

    def __init__(self) -> None:
        self.latest: dict[str, Sample] = {}
        self.faults = 0
        self._waiting: deque[tuple[asyncio.Future[list[Sample]], float]] = deque()
        """Futures of pending requests for an odometry line, with their start times."""
        self.done = asyncio.Event()

    def take(self, line: bytes, now: float) -> None:
        """Store the readings in a line, and complete the request that is waiting for this line."""
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
                return  # the reply to a request that has timed out

    def ask(self) -> asyncio.Future[list[Sample]]:
        """Return a future for the next odometry line."""
        if len(self._waiting) >= MOST_WAITING:
            raise ConnectionError("too many pending requests")
        answer: asyncio.Future[list[Sample]] = asyncio.get_running_loop().create_future()
        self._waiting.append((answer, time.monotonic()))
        return answer

    def lost(self) -> None:
        """Let all pending requests fail with `ConnectionError`."""
        while self._waiting:
            answer, _ = self._waiting.popleft()
            if not answer.done():
                answer.set_exception(ConnectionError("the robot has disconnected"))
        self.done.set()


def request(vx: float, wz: float) -> bytes:
    """Return the frame for a clamped speed; raise `ValueError` for an invalid number."""
    if not isfinite(vx + wz):
        raise ValueError("a speed must be a finite number")
    vx = max(-1.0, min(1.0, vx))
    wz = max(-2.0, min(2.0, wz))
    return f"VEL {vx * 1000:.1f} {wz * 57.3:.2f}\n".encode()


class StreamDriver:
    """A driver with `StreamReader`, `StreamWriter` and a reader task: the most common design."""

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
        """The newest reading of each signal, by name."""
        return self._robot.latest

    @property
    def faults(self) -> int:
        """Number of invalid lines received."""
        return self._robot.faults

    async def _read(self) -> None:
        """Read and store lines until the connection ends, and complete pending requests."""
        try:
            while True:
                try:
                    line = await self._reader.readline()
                except ValueError:  # too long, and already dropped by the reader
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
        """Send a speed, and return the robot's reply."""
        self._writer.write(request(vx, wz))
        answer = self._robot.ask()
        async with asyncio.timeout(REPLY_S):
            await self._writer.drain()
            samples = await answer
        return {sample.signal: sample.value for sample in samples}

    async def flood(self, count: int) -> None:
        """Request `count` lines, and wait until all lines have arrived."""
        self._robot.done.clear()
        self._writer.write(b"FLOOD %d\n" % count)
        async with asyncio.timeout(60):
            await self._writer.drain()
            await self._robot.done.wait()

    async def close(self) -> None:
        """Close the connection."""
        self._task.cancel()
        self._writer.close()
