"""Faults to inject into an emulated robot: delay, loss, noise and failed sensors.

Pure. Runs with the same traffic and the same faults drop the same frames.
"""

import math
import re
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from urc.config.node import duration_s
from urc.model.payload import Payload
from urc.model.values import Reading
from urc.problems import UrcError
from urc.simulator.world.chance import uniform

__all__ = ["FAULTS", "Fault", "Faults", "DelayLine", "parse_fault"]

MOST_LATE: Final = 1024
"""Maximum number of delayed frames per connection; further frames are dropped."""
_LONGEST_S: Final = 60.0
_LOUDEST: Final = 1000.0

FAULTS: Final[Mapping[str, str]] = {
    "delay": "delay=200ms",
    "loss": "loss=5%",
    "silent": "silent",
    "noise": "noise=2x",
    "dropout": "dropout=SIGNAL",
    "stuck": "stuck=SIGNAL",
    "low-battery": "low-battery",
}
"""Syntax of each fault, keyed by name."""


class Fault(NamedTuple):
    """One injected fault."""

    name: str
    amount: float = 0.0
    """Delay in seconds, fraction of lost frames (0 to 1), or noise factor."""
    signal: str = ""
    """Name of the affected signal, for the faults ``dropout`` and ``stuck``."""
    text: str = ""
    """Text of the fault, in the syntax of `FAULTS`."""


def parse_fault(text: str) -> Fault:
    """Parse a fault in the syntax of `FAULTS`.

    Raises:
        UrcError: the text is not a fault; the message lists all faults.
    """
    name, _, value = text.strip().partition("=")
    if name not in FAULTS:
        raise UrcError(f"unknown fault {name!r}; known faults: {', '.join(FAULTS.values())}")
    wanted = UrcError(f"fault {name}: expected {FAULTS[name]}, found {text.strip()!r}")
    if ("=" in FAULTS[name]) != bool(value):
        raise wanted
    amount, signal = 0.0, ""
    if name == "delay":
        amount = _within(_duration(value, wanted), 0.0, _LONGEST_S, wanted)
    elif name == "loss":
        amount = _within(_number(value, "%", wanted) / 100, 0.0, 1.0, wanted)
    elif name == "noise":
        amount = _within(_number(value, "x", wanted), 0.0, _LOUDEST, wanted)
    else:
        signal = value
    return Fault(name, amount, signal, text.strip())


def _duration(value: str, wanted: UrcError) -> float:
    try:
        return duration_s(value)
    except ValueError:
        raise wanted from None


def _number(value: str, sign: str, wanted: UrcError) -> float:
    found = re.fullmatch(rf"([0-9]{{1,6}}(?:\.[0-9]{{1,6}})?){sign}?", value, re.ASCII)
    if found is None:
        raise wanted
    return float(found[1])


def _within(value: float, low: float, high: float, wanted: UrcError) -> float:
    if not low <= value <= high:
        raise wanted
    return value


class Faults:
    """The active faults of one robot."""

    def __init__(self, missing: frozenset[str] = frozenset()) -> None:
        """Begin without faults.

        Args:
            missing: signals whose sensors need a package that is not installed.
        """
        self.active: dict[str, Fault] = {}
        """Faults, keyed by name; faults of a signal are keyed by name and signal."""
        self._missing = missing
        self.dropped = missing
        """Signals whose sensors have failed."""
        self.stuck: dict[str, Reading] = {}
        """Last values of stuck signals, keyed by name."""
        self._frames = 0

    @property
    def delay_s(self) -> float:
        """Delay of every reply, in seconds."""
        fault = self.active.get("delay")
        return fault.amount if fault is not None else 0.0

    @property
    def is_silent(self) -> bool:
        """Whether a fault drops all replies."""
        return "silent" in self.active

    def add(self, fault: Fault) -> None:
        """Add a fault, replacing any previous fault with the same name and signal."""
        key = f"{fault.name} {fault.signal}".strip()
        self.active[key] = fault

    def clear(self) -> None:
        """Remove all faults."""
        self.active.clear()
        self.dropped = self._missing
        self.stuck.clear()

    def loses(self) -> bool:
        """Return whether the next frame, in either direction, is lost."""
        fault = self.active.get("loss")
        if fault is None:
            return False
        self._frames += 1
        return uniform(1, self._frames, "loss") < fault.amount

    def apply(self, frames: Iterable[Payload]) -> list[Payload]:
        """Return the frames that the active faults do not drop."""
        return [] if self.is_silent else [one for one in frames if not self.loses()]

    def drops(self, names: Iterable[str]) -> bool:
        """Return whether a dropout fault affects any of the signals."""
        return bool(self.dropped) and not self.dropped.isdisjoint(names)


class DelayLine:
    """The delayed frames of one connection."""

    def __init__(self) -> None:
        """Begin without frames."""
        self._waiting: deque[tuple[float, Payload]] = deque()
        self.lost = 0
        """Number of frames dropped because the queue was full."""

    @property
    def due_s(self) -> float:
        """Due time of the first frame, as passed to `push`; ``inf`` if the queue is empty."""
        return self._waiting[0][0] if self._waiting else math.inf

    def push(self, frames: Sequence[Payload], due_s: float) -> None:
        """Add frames to the queue, to be sent at the time `due_s`."""
        for one in frames:
            if len(self._waiting) >= MOST_LATE:
                self.lost += 1
            else:
                self._waiting.append((due_s, one))

    def pop_due(self, now_s: float) -> list[Payload]:
        """Remove and return the frames that are due at `now_s`."""
        due: list[Payload] = []
        while self._waiting and self._waiting[0][0] <= now_s + 1e-9:
            due.append(self._waiting.popleft()[1])
        return due
