"""A robot profile: one robot, its settings, its driver, its interfaces, its own tests."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from urc.expressions import Template
from urc.model.codec import Envelope, ReadSpec, WriteSpec
from urc.model.driver import Driver, FramingSpec
from urc.model.interface import Interface, WidgetUse
from urc.model.values import NOTHING, Alarm, Reading, Value
from urc.model.widget import Widget
from urc.model.world import WorldSpec
from urc.patterns import Pattern

__all__ = [
    "DialogueStep",
    "DocumentTest",
    "Expected",
    "Fed",
    "Profile",
    "Reaction",
    "Setting",
    "SimulatorRule",
    "State",
    "pieces_of",
]


class Setting(NamedTuple):
    """Something the operator fills in, or overrides by ``--set``."""

    name: str
    type: Literal["string", "host", "port", "integer", "number", "boolean", "choice", "path"]
    title: str = ""
    default: Value = None
    """None: must be filled in before Connect."""
    choices: tuple[str, ...] = ()
    min: float | None = None
    max: float | None = None
    is_secret: bool = False
    description: str = ""
    is_required: bool = True
    """Whether it must be filled in before Connect, where it has no default."""

    @property
    def empty(self) -> Value:
        """What it is in templates where it stays empty: no text, or nothing."""
        return None if self.type in ("port", "integer", "number", "boolean") else ""

    def is_missing(self, value: Value) -> bool:
        """Return whether `value` keeps the robot from being connected.

        What a document gives counts as filled in, an empty text, too.
        """
        return self.is_required and (value is None or (value == "" and self.default != ""))


Fed = str | bytes | Envelope
"""Text in the line's encoding, or bytes, or what goes over a transport that carries messages."""


def pieces_of(fed: Fed | tuple[Fed, ...]) -> tuple[Fed, ...]:
    """Return what is fed, piece by piece: each comes by itself."""
    return (fed,) if isinstance(fed, (str, bytes, Envelope)) else fed


class State(NamedTuple):
    """What a test says of a signal beside its value."""

    has_value: bool = False
    """Whether `value` must be the signal's."""
    value: Value | tuple[Value, ...] = None
    alarm: Alarm | None = None
    """Which limit it must have passed, "" for none; None: whichever."""
    age: Literal["", "fresh", "stale", "never"] = ""
    """Whether it must be fresh, old or never set; "": whichever."""


Expected = Value | tuple[Value, ...] | State
"""What a signal must be; of an array, all its elements."""


class DialogueStep(NamedTuple):
    """One step of a test: at most one thing that happens, then what must be so."""

    line: int = 1
    """1-based, where it stands."""
    column: int = 1
    """1-based."""
    source: str = ""
    """The text of its line."""
    feed: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → what the robot says."""
    run: str = ""
    """Command that is run."""
    arguments: Mapping[str, Reading] = NOTHING
    wait_s: float | None = None
    """Time that passes on the test's own clock."""
    connects: str = ""
    """Transport that becomes connected."""
    closes: str = ""
    """Transport whose connection the robot ends."""
    leaves: bool = False
    """The operator goes: all lines say their good-bye."""
    sent: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → all that was sent there since a step last told it; () is nothing."""
    expect: Mapping[str, Expected] = NOTHING
    reply: Mapping[str, Value | tuple[Value, ...]] | None = None
    """Values of the reply to the command that ended first of those not told yet."""
    of: str = ""
    """Command whose end `reply` or `fails` is about; "" for any."""
    fails: str = ""
    """What a failure must say."""
    closed: str = ""
    """Transport that must have been closed from this side."""


class DocumentTest(NamedTuple):
    """A test that a document carries about itself."""

    name: str
    line: int
    """1-based, where it stands in the document."""
    feed: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → what the robot says at once, or one after the other; see `pieces_of`."""
    reply_to: int | str | None = None
    """Index of the poll, or name of the command, that is waiting when the text arrives."""
    run: str | None = None
    """Command to run."""
    arguments: Mapping[str, Reading] = NOTHING
    expect: Mapping[str, Expected] = NOTHING
    """Signal → what it is after it."""
    sent: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → exact text sent, without what the framing adds; or every byte on the wire."""
    fails: str | None = None
    """What the failure must say, when the test is about a failure."""
    file: str = ""
    """The document it stands in."""
    column: int = 1
    """1-based."""
    source: str = ""
    """The text of its line, for the caret."""
    settings: Mapping[str, Value] = NOTHING
    """Settings that differ from their defaults."""
    steps: tuple[DialogueStep, ...] = ()
    """One after the other, instead of all in one instant."""
    polls: tuple[str, ...] = ()
    """Polls that are asked while the steps are done, at their own times."""
    is_ready: bool = False
    """Whether the lines are usable at once when the steps begin."""


class Reaction(NamedTuple):
    """One thing that the emulated robot does; its attributes in the order of doing."""

    after_s: float = 0.0
    """Time since the one before."""
    sets: Mapping[str, Template | Reading] = NOTHING
    """Signal or name of the robot's state → its new value, or a template for it."""
    answers: bool = False
    """Whether the answer that the driver declares for the request is given."""
    send: WriteSpec | None = None
    """None: nothing of its own is said."""
    message: str = ""
    """Declared message that is said."""
    framing: FramingSpec | None = None
    """Of `send`; None: the line's own, or that of the reply to the request."""
    closes: bool = False
    """Whether the robot ends the connection."""


class SimulatorRule(NamedTuple):
    """What the emulated robot does with a frame that matches, or every so often."""

    transport: str
    match: Pattern | ReadSpec | None = None
    """Frames that it takes: their text, or all that this reads."""
    request: str = ""
    """Command or poll whose frames it takes."""
    every_s: float | None = None
    """Period of a rule that takes no frames."""
    when: Template | None = None
    """The rule is passed over where it does not hold."""
    reactions: tuple[Reaction, ...] = (Reaction(),)
    name: str = ""
    """By which other documents change it; "" for none."""


class Profile(NamedTuple):
    """One robot, ready to be connected once its settings are complete."""

    name: str
    title: str
    file: str
    summary: str = ""
    settings: Mapping[str, Setting] = NOTHING
    driver: Driver = Driver()
    slots: Mapping[str, WidgetUse] = NOTHING
    """The driver's part of the look: what fills each slot unless an interface says otherwise."""
    interfaces: Mapping[str, Interface] = NOTHING
    """Never empty: without any, one named ``default`` is made."""
    widgets: Mapping[str, Widget] = NOTHING
    """Every widget the profile uses, by name."""
    tests: tuple[DocumentTest, ...] = ()
    simulator: tuple[SimulatorRule, ...] = ()
    emulated: Mapping[str, Reading] = NOTHING
    """Values with which the emulated robot begins: signals, and names of its own state."""
    world: WorldSpec | None = None
    """Body and surroundings of the emulated robot; None: it has none."""
    licence: str = ""
    """SPDX identifier, as the document says."""
    author: str = ""
