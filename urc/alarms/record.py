"""The state of one alarm, and the events in its history.

Layer 3. Pure. All times are in UTC seconds since 1970, because shelving ends at a time of day and
states survive a restart.
"""

from typing import Final, Literal, NamedTuple

from urc.model.values import Alarm, AlarmLimits, AlarmPriority, Reading, state_texts

__all__ = [
    "PRIORITIES",
    "AlarmEvent",
    "AlarmEventKind",
    "AlarmRecord",
    "AlarmState",
    "condition_of",
    "severity",
    "text_of_value",
]

PRIORITIES: Final[tuple[AlarmPriority, ...]] = ("high", "medium", "low")
"""Priorities, in order of decreasing urgency."""
AlarmState = Literal[
    "normal", "unacknowledged", "acknowledged", "returned", "shelved", "suppressed"
]
"""State of an alarm; ``returned``: returned to normal, but not acknowledged."""
AlarmEventKind = Literal[
    "raised", "changed", "returned", "acknowledged", "shelved", "unshelved", "suppressed",
    "unsuppressed", "unknown", "removed", "flood began", "flood ended",
]  # fmt: skip
"""Kind of an alarm event. ``changed``: less severe than before. ``unknown``: the value became
unknown. ``removed``: the robot's document no longer declares the alarm."""
_MILD: Final = ("low", "high", "minor")
_SAME_SIDE: Final = {("lolo", "low"), ("hihi", "high")}
_LONGEST_VALUE: Final = 100


class AlarmRecord(NamedTuple):
    """The alarm of one signal: its condition, its times, and the operators' actions."""

    signal: str
    condition: str
    """Crossed limit or alarm state; after a return to normal, the condition that ended."""
    priority: AlarmPriority
    number: int
    """Number of the activation, counted per robot; these numbers give the first-out order."""
    group: int
    """Number of the burst to which the activation belongs."""
    began_at: float
    raised: int
    """Number of the last event that requires acknowledgement; see `AlarmList.acknowledge`."""
    value: str = ""
    """Value of the signal at the alarm's last change, as text."""
    is_active: bool = True
    is_known: bool = True
    """Whether the current value is known; an alarm with an unknown value stays in the list."""
    is_acknowledged: bool = False
    is_suppressed: bool = False
    times: int = 1
    """Number of activations since the alarm was last normal."""
    returned_at: float = 0.0
    """Time of the last return to normal; 0 while the alarm is active."""
    acknowledged_at: float = 0.0
    acknowledged_by: str = ""
    shelved_until: float = 0.0
    """Time at which shelving ends; 0 for an unshelved alarm."""
    shelved_by: str = ""

    @property
    def state(self) -> AlarmState:
        """State of the alarm; ``shelved`` and ``suppressed`` take precedence over other states."""
        if self.shelved_until:
            return "shelved"
        if self.is_active:
            if self.is_suppressed:
                return "suppressed"
            return "acknowledged" if self.is_acknowledged else "unacknowledged"
        return "normal" if self.is_acknowledged else "returned"

    @property
    def is_annunciated(self) -> bool:
        """Whether the alarm must be shown to operators."""
        return self.state in ("unacknowledged", "acknowledged", "returned")


class AlarmEvent(NamedTuple):
    """One event in a robot's alarm history."""

    at: float
    signal: str
    """The signal's name; "" for a flood."""
    kind: AlarmEventKind
    condition: str = ""
    priority: AlarmPriority = "medium"
    value: str = ""
    state: AlarmState = "normal"
    """State of the alarm after the event."""
    who: str = ""
    """Name of the person, device or program that acted; "" if the robot or a timer acted."""
    principal: str = ""
    until: float = 0.0
    """Time at which shelving ends; 0 if the alarm is not shelved."""
    times: int = 1
    """Number of activations since the alarm was last normal."""


def condition_of(alarm: Alarm, value: Reading, limits: AlarmLimits) -> str:
    """Return the limit or alarm state that caused a sample's alarm; "" if there is no alarm."""
    if alarm not in ("major", "minor"):
        return alarm
    wanted = "high" if alarm == "major" else ""
    words = [word for word in state_texts(value) if word in limits.states]
    graver = (word for word in words if limits.attributes_of(word).priority == wanted)
    # During an off-delay, the value has already left the alarm state.
    return next(graver, words[0] if words else alarm)


def severity(condition: str, priority: AlarmPriority) -> tuple[int, int]:
    """Return a sort key by severity; the most severe alarm has the smallest key."""
    return PRIORITIES.index(priority), int(condition in _MILD)


def is_easing(before: str, after: str) -> bool:
    """Return whether a change of condition makes an alarm less severe, such as from lolo to low."""
    return (before, after) in _SAME_SIDE


def text_of_value(value: Reading) -> str:
    """Return a signal's value as text for the alarm list; bytes become their size."""
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.6g}"
    return ("" if value is None else str(value))[:_LONGEST_VALUE]
