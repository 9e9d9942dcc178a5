"""A robot profile: settings, driver, interfaces and tests of one robot."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from urc.expressions import Template
from urc.model.driver import Driver, FramingSpec
from urc.model.interface import Interface, WidgetUse
from urc.model.payload import Envelope, ReadSpec, WriteSpec
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
    "ExpectedState",
    "pieces_of",
]


class Setting(NamedTuple):
    """A value that the operator fills in or overrides by ``--set``."""

    name: str
    type: Literal["string", "host", "port", "integer", "number", "boolean", "choice", "path"]
    title: str = ""
    default: Value = None
    """Default value; None: the operator has to fill it in before Connect."""
    choices: tuple[str, ...] = ()
    min: float | None = None
    max: float | None = None
    is_secret: bool = False
    description: str = ""
    is_required: bool = True
    """Whether a value is required before Connect, if there is no default."""

    @property
    def empty(self) -> Value:
        """Value of an empty setting in templates: an empty text, or None."""
        return None if self.type in ("port", "integer", "number", "boolean") else ""

    def is_missing(self, value: Value) -> bool:
        """Return whether `value` prevents the connection of the robot.

        A value from a document counts as filled in, even an empty text.
        """
        return self.is_required and (value is None or (value == "" and self.default != ""))


Fed = str | bytes | Envelope
"""Text in the encoding of the connection, bytes, or an envelope."""


def pieces_of(fed: Fed | tuple[Fed, ...]) -> tuple[Fed, ...]:
    """Return the pieces of the input; each arrives separately."""
    return (fed,) if isinstance(fed, (str, bytes, Envelope)) else fed


class ExpectedState(NamedTuple):
    """The expected state of a signal, in addition to its value."""

    has_value: bool = False
    """Whether `value` is compared."""
    value: Value | tuple[Value, ...] = None
    alarm: Alarm | None = None
    """Expected alarm, "" for normal; None: any."""
    age: Literal["", "fresh", "stale", "never"] = ""
    """Expected age: fresh, old or never set; "": any."""


Expected = Value | tuple[Value, ...] | ExpectedState
"""Expected value of a signal, or of all elements of an array."""


class DialogueStep(NamedTuple):
    """One step of a test: at most one action, then the expected results."""

    line: int = 1
    """1-based line in the document."""
    column: int = 1
    """1-based."""
    source: str = ""
    """Text of the line in the document."""
    feed: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → input from the robot."""
    run: str = ""
    """Name of the command to run."""
    arguments: Mapping[str, Reading] = NOTHING
    wait_s: float | None = None
    """Time that passes on the clock of the test, in seconds."""
    connects: str = ""
    """Name of the transport that connects."""
    closes: str = ""
    """Name of the transport whose connection the robot closes."""
    leaves: bool = False
    """Whether the operator leaves: all connections close in order."""
    sent: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → all output since the last check of it; () for no output."""
    expect: Mapping[str, Expected] = NOTHING
    reply: Mapping[str, Value | tuple[Value, ...]] | None = None
    """Expected reply values of the first completed command that no step has checked yet."""
    of: str = ""
    """Command of `reply` or `fails`; "" for any."""
    fails: str = ""
    """Expected failure message."""
    closed: str = ""
    """Name of the transport that URC has closed."""


class DocumentTest(NamedTuple):
    """A test that a document carries for itself."""

    name: str
    line: int
    """1-based line in the document."""
    feed: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → input from the robot, in one piece or several; see `pieces_of`."""
    reply_to: int | str | None = None
    """Index of the poll, or name of the command, that awaits the reply."""
    run: str | None = None
    """Command to run."""
    arguments: Mapping[str, Reading] = NOTHING
    expect: Mapping[str, Expected] = NOTHING
    """Signal → expected value after the test."""
    sent: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Transport → exact payload without framing, or all bytes on the wire."""
    fails: str | None = None
    """Expected failure message, for a test of a failure."""
    file: str = ""
    """Path of the document."""
    column: int = 1
    """1-based."""
    source: str = ""
    """Text of the line in the document, for error messages."""
    settings: Mapping[str, Value] = NOTHING
    """Setting → value, where it differs from the default."""
    steps: tuple[DialogueStep, ...] = ()
    """Steps in order, instead of a single instant."""
    polls: tuple[str, ...] = ()
    """Names of the polls that run on schedule during the steps."""
    is_ready: bool = False
    """Whether the connections are ready before the first step."""


class Reaction(NamedTuple):
    """One reaction of the emulated robot; the attributes are in the order of execution."""

    after_s: float = 0.0
    """Time since the previous reaction, in seconds."""
    sets: Mapping[str, Template | Reading] = NOTHING
    """Signal or state variable of the robot → its new value, or a template for it."""
    answers: bool = False
    """Whether the robot sends the reply that the driver declares for the request."""
    send: WriteSpec | None = None
    """Frame to send; None: no frame."""
    message: str = ""
    """Name of the declared message to send."""
    framing: FramingSpec | None = None
    """Framing of `send`; None: that of the connection, or of the reply to the request."""
    closes: bool = False
    """Whether the robot closes the connection."""


class SimulatorRule(NamedTuple):
    """A rule of the emulated robot, for matching frames or at fixed intervals."""

    transport: str
    match: Pattern | ReadSpec | None = None
    """Matching frames: a pattern of their text, or a form that reads them."""
    request: str = ""
    """Command or poll whose frames match."""
    every_s: float | None = None
    """Period of a timed rule, in seconds."""
    when: Template | None = None
    """Condition of the rule; the rule is skipped while it is false."""
    reactions: tuple[Reaction, ...] = (Reaction(),)
    name: str = ""
    """Name by which other documents override the rule; "" for none."""


class Profile(NamedTuple):
    """One robot, ready to connect once its settings are complete."""

    name: str
    title: str
    file: str
    summary: str = ""
    settings: Mapping[str, Setting] = NOTHING
    driver: Driver = Driver()
    slots: Mapping[str, WidgetUse] = NOTHING
    """Slot → widget of the driver, unless an interface overrides it."""
    interfaces: Mapping[str, Interface] = NOTHING
    """Name → interface; never empty, since ``default`` is added if missing."""
    widgets: Mapping[str, Widget] = NOTHING
    """Name → widget, for all widgets of the profile."""
    tests: tuple[DocumentTest, ...] = ()
    simulator: tuple[SimulatorRule, ...] = ()
    emulated: Mapping[str, Reading] = NOTHING
    """Initial values of the emulated robot: signals and its own state variables."""
    world: WorldSpec | None = None
    """Body and surroundings of the emulated robot; None: no world."""
    licence: str = ""
    """SPDX identifier from the document."""
    author: str = ""
