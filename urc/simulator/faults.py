"""What goes wrong on demand with an emulated robot: slow, lossy, noisy, with sensors that fail.

Pure. The same faults and the same traffic lose the same frames.
"""

import math
import re
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from urc.config.part import duration_s
from urc.model.codec import Payload
from urc.model.values import Reading
from urc.problems import UrcError
from urc.simulator.world.chance import uniform

__all__ = ["FAULTS", "Fault", "Faults", "Late", "parse_fault"]

MOST_LATE: Final = 1024
"""Frames of one line that wait for their time; beyond them the newest are lost."""
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
"""Fault → how it is written."""


class Fault(NamedTuple):
    """One thing that goes wrong."""

    name: str
    amount: float = 0.0
    """Seconds of a delay, share of frames that are lost, how many times as noisy."""
    signal: str = ""
    """Signal that drops out or is stuck."""
    text: str = ""
    """As it was written."""


def parse_fault(text: str) -> Fault:
    """Return what is written like one of `FAULTS`.

    Raises:
        UrcError: it is none; one line that says which there are.
    """
    name, _, value = text.strip().partition("=")
    if name not in FAULTS:
        raise UrcError(f"there is no fault {name!r}; there are {', '.join(FAULTS.values())}")
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
    """What is wrong with one robot now."""

    def __init__(self) -> None:
        """Begin with nothing wrong."""
        self.active: dict[str, Fault] = {}
        """By name, and the signal where there is one."""
        self.dropped: frozenset[str] = frozenset()
        """Signals whose sensors have failed."""
        self.stuck: dict[str, Reading] = {}
        """Signals that no longer change, with the value at which they stopped."""
        self._frames = 0

    @property
    def delay_s(self) -> float:
        """How late everything is said."""
        fault = self.active.get("delay")
        return fault.amount if fault is not None else 0.0

    @property
    def is_silent(self) -> bool:
        """Whether nothing is said at all."""
        return "silent" in self.active

    def add(self, fault: Fault) -> None:
        """Let something go wrong, too; a second one of a kind takes the first one's place."""
        key = f"{fault.name} {fault.signal}".strip()
        self.active[key] = fault

    def clear(self) -> None:
        """Let nothing be wrong any more."""
        self.active.clear()
        self.dropped = frozenset()
        self.stuck.clear()

    def loses(self) -> bool:
        """Return whether the next frame is lost, in whichever direction."""
        fault = self.active.get("loss")
        if fault is None:
            return False
        self._frames += 1
        return uniform(1, self._frames, "loss") < fault.amount

    def said(self, frames: Iterable[Payload]) -> list[Payload]:
        """Return what is left of frames on their way to a client."""
        return [] if self.is_silent else [one for one in frames if not self.loses()]

    def drops(self, names: Iterable[str]) -> bool:
        """Return whether one of several signals has dropped out."""
        return bool(self.dropped) and not self.dropped.isdisjoint(names)


class Late:
    """What one line says later than it should."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._waiting: deque[tuple[float, Payload]] = deque()
        self.lost = 0
        """Frames for which there was no room."""

    @property
    def due_s(self) -> float:
        """When the first is due, by the clock of `put`; ``inf`` when none waits."""
        return self._waiting[0][0] if self._waiting else math.inf

    def put(self, frames: Sequence[Payload], due_s: float) -> None:
        """Keep frames until `due_s`."""
        for one in frames:
            if len(self._waiting) >= MOST_LATE:
                self.lost += 1
            else:
                self._waiting.append((due_s, one))

    def take(self, now_s: float) -> list[Payload]:
        """Return what is due."""
        due: list[Payload] = []
        while self._waiting and self._waiting[0][0] <= now_s + 1e-9:
            due.append(self._waiting.popleft()[1])
        return due
