"""A desk among robots and screens that keep what they are told."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from urc.model.driver import Argument, Command, Driver, TransportSpec
from urc.model.exchange import Hold
from urc.model.payload import Payload, WriteSpec
from urc.model.values import Reading
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import HoldTerms, StopReport
from urc.motion.lease import LeaseState, Operator
from urc.runtime.motion_controller import MotionController
from urc.testing.movers import FakeFrames, FakeSession

__all__ = ["DRIVER", "Movers", "Scene", "held"]

SPEED = Argument("speed", min=-1.0, max=1.0, default=0.0, is_required=False)


def held(name: str, line: str = "wire") -> Command:
    """Return a held command with a speed."""
    hold = Hold(0.05, {"speed": 0.0}, 0.3)
    return Command(name, line, WriteSpec("text", {}), {"speed": SPEED}, hold=hold)


DRIVER = Driver(
    {"wire": TransportSpec("wire", "tcp"), "air": TransportSpec("air", "udp")},
    commands={
        "drive": held("drive"),
        "lift": held("lift", "air"),
        "beep": Command("beep", "wire", WriteSpec("text", {})),
    },
)


class Movers:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.terms: dict[str, HoldTerms] = {}
        self.is_up = True
        self.owing: set[str] = set()
        """Commands whose stops have not reached the robot."""
        self.disarmed: set[str] = set()
        """Commands that a lost connection has disarmed."""

    def arm(self, command: str, terms: HoldTerms) -> None:
        self.told.append(f"arm {command}")
        self.terms[command] = terms

    def is_armed(self, command: str) -> bool:
        return command not in self.disarmed

    def tick(self, command: str, data: Payload, for_s: float = inf) -> None:
        assert isinstance(data, bytes)
        self.told.append(data.decode() if for_s == inf else f"{data.decode()} for {for_s:.2f} s")

    def renew(self, command: str, stop: Payload) -> None:
        assert isinstance(stop, bytes)
        assert command in stop.decode()
        self.told.append(f"stop is {stop.decode()}")

    def is_stopping(self, command: str) -> bool:
        return False

    def owes_stop(self, command: str) -> bool:
        return command in self.owing

    def is_open(self, command: str) -> bool:
        assert command
        return self.is_up

    def release(self, command: str) -> None:
        self.told.append(f"release {command}")

    def stop(self, stops: Mapping[str, Payload]) -> None:
        self.told.append(f"stop {' '.join(stops)}")

    async def stops(self) -> Sequence[tuple[str, StopReport]]:
        raise NotImplementedError


class Scene:
    """A desk with a robot, two drivers, an engineer and a viewer."""

    def __init__(
        self,
        kept: LeaseState | None = None,
        *,
        is_owed: bool = False,
        is_attached: bool = True,
        driver: Driver = DRIVER,
    ) -> None:
        self.controller = MotionController(driver, kept=kept, is_owed=is_owed)
        self.backend = Movers()
        self.frames = FakeFrames(driver)
        if is_attached:
            self.controller.attach(FakeSession(self.frames, self.backend))
        for name, role in {"ann": "drive", "bob": "drive", "eve": "maintain"}.items():
            self.controller.join(Operator(name, name, role))  # type: ignore[arg-type]
        self.controller.join(Operator("vic", "vic", "watch"))
        self.now = 100.0
        self._number = 0

    def tick(
        self, who: str = "ann", command: str = "drive", *, sees: float = inf, **arguments: Reading
    ) -> str:
        """Tick as a page does that has just heard the beat, and that sees an image of an age."""
        self._number += 1
        self.now += 0.05
        echo = self.controller.heartbeat(who, self.now)
        given = ControlInput(self.controller.lease.state.epoch, self._number, echo)
        if sees == inf:
            return self.controller.tick(who, command, arguments, given, self.now)
        return self.controller.tick(who, command, arguments, given, self.now, sees)

    def drive(self, who: str, verb: str, **more: Any) -> str:
        """Say something about the controls."""
        return self.controller.drive(who, verb, self.now, **more)

    def heard(self) -> list[str]:
        """Return what the movers were told since the last call."""
        told, self.backend.told = self.backend.told, []
        return told
