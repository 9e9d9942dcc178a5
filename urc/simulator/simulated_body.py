"""The body of an emulated robot, controlled by the robot's state, with sensors for signals.

The module uses no sockets and no clock. The fail-safe works with and without a connection. The
fail-safe is declared in the document (`failsafe`) or derived from held commands (`watchdog`).
"""

import logging
import math
import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.util import find_spec

from urc.expressions import ExpressionError, Template
from urc.model.driver import Driver
from urc.model.values import Reading
from urc.model.world import Failsafe, WorldSpec
from urc.simulator.world.world import SensorView, World

__all__ = ["SimulatedBody", "failsafe_of", "has_rendering", "rendered_signals"]

log = logging.getLogger("urc.simulator.emulated_robot")
_KEPT = ("flies", "cut")
"""Inputs that the fail-safe leaves active, because they cause no motion. For example, a
drone without commands stays in the air."""

_LOOKS = re.compile(r"_item\(ns\['world'\], '(laser|point_cloud|picture|panorama|top)'\)")
"""Pattern for references to sensors that need numpy or Pillow."""

Evaluate = Callable[[Template, float], object]
"""Function that evaluates a template with the robot's signals and state at a given time."""


class SimulatedBody:
    """The body of one emulated robot.

    Args:
        spec: declaration of the world.
        driver: driver of the robot.
        evaluate: function that returns the value of a template.
        put: function that sets a value in the robot's state.
        is_plain: see `World`.
    """

    def __init__(
        self,
        spec: WorldSpec,
        driver: Driver,
        evaluate: Evaluate,
        put: Callable[[str, object], None],
        *,
        is_plain: bool = False,
    ) -> None:
        self.spec = spec
        self.world = World(
            spec, self._inputs, self._holds, has_rendering=has_rendering(), is_plain=is_plain
        )
        self.failsafe = spec.failsafe or failsafe_of(driver)
        self._evaluate = evaluate
        self._put = put
        self._heard_s = -math.inf
        """Time of the last command that reset the fail-safe timer."""
        self._is_safe = True
        """Whether the fail-safe has acted since the last command."""
        self._last_fault = ""

    def note_commands(self, labels: Iterable[str], now_s: float) -> None:
        """Restart the fail-safe timer if a received frame may be a command that restarts the timer.

        Args:
            labels: names of the commands that may have produced the frame.
            now_s: time of the frame, in seconds since the epoch.
        """
        if self.failsafe is not None and not {*labels}.isdisjoint(self.failsafe.without):
            self._heard_s, self._is_safe = now_s, False

    def prepare(self) -> None:
        """Load the laser and camera modules if a signal needs them; the call may block."""
        if has_rendering() and rendered_signals(self.spec):
            import urc.simulator.world.laser
            import urc.simulator.world.picture  # noqa: F401  # imported only to load it

    def view(self, now_s: float) -> SensorView:
        """Advance the world to `now_s`, and return its sensor view."""
        return self.world.view(now_s)

    def sense(self, name: str, now_s: float) -> object:
        """Return the world's value of a signal; raise `ExpressionError` if there is no value."""
        self.world.advance(now_s)
        return self._evaluate(self.spec.senses[name], now_s)

    def picture(self, name: str, now_s: float) -> bytes | None:
        """Return the image of a signal; None if the signal's value is not an image."""
        value = self.sense(name, now_s)
        return value if isinstance(value, bytes) else None

    def _inputs(self, time_s: float) -> Mapping[str, float]:
        failsafe = self.failsafe
        is_lost = failsafe is not None and time_s - self._heard_s > failsafe.after_s
        if is_lost and failsafe is not None and failsafe.sets and not self._is_safe:
            self._is_safe = True
            for name, value in failsafe.sets.items():
                self._put(name, self._value(value, time_s))
        stands = is_lost and failsafe is not None and not failsafe.sets
        return {
            name: self._number(name, value, time_s)
            for name, value in self.spec.drive.items()
            if not stands or name in _KEPT
        }

    def _holds(self, value: Template | bool) -> bool:
        return bool(self._value(value, self.world.time_s or 0.0))

    def _value(self, value: Template | Reading, time_s: float) -> object:
        if not isinstance(value, Template):
            return value
        try:
            return self._evaluate(value, time_s)
        except ExpressionError as error:
            self._log(str(error))
            return None

    def _number(self, name: str, value: Template | float, time_s: float) -> float:
        found = self._value(value, time_s)
        if isinstance(found, (int, float)) and math.isfinite(found):
            return float(found)
        self._log(f"world.drive.{name}: expected a number, found {found!r}")
        return 0.0

    def _log(self, text: str) -> None:
        if text != self._last_fault:
            self._last_fault = text
            log.info("%s", text)


@cache
def has_rendering() -> bool:
    """Return whether the packages for cameras and laser scanners are installed (extra `demo`)."""
    try:
        return find_spec("numpy") is not None and find_spec("PIL") is not None
    except ModuleNotFoundError:  # hidden, as in browsers
        return False


def rendered_signals(spec: WorldSpec, without: frozenset[str] = frozenset()) -> frozenset[str]:
    """Return the signals that need numpy or Pillow, except for the readings in `without`."""
    found = {name: set(_LOOKS.findall(one.python)) for name, one in spec.senses.items()}
    return frozenset(name for name, readings in found.items() if readings - without)


def failsafe_of(driver: Driver) -> Failsafe | None:
    """Return a fail-safe from the `watchdog` or `step` of the held commands, or None.

    Return None if there are no held commands, or if one of these times is missing or infinite.
    """
    held = {name: one.hold for name, one in driver.commands.items() if one.hold is not None}
    times = [hold.step_s or hold.watchdog_s for hold in held.values()]
    if not times or any(one is None or not math.isfinite(one) for one in times):
        return None
    return Failsafe(max(one for one in times if one is not None), tuple(held))
