"""A robot profile: settings, driver, interfaces and tests of one robot."""

from collections.abc import Iterator, Mapping
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
    """A value of one robot, which the operator fills in on a page or sets with ``--set``."""

    name: str
    type: Literal["string", "host", "port", "integer", "number", "boolean", "choice", "path"]
    title: str = ""
    default: Value = None
    """Default value; None means that the setting has no default."""
    choices: tuple[str, ...] = ()
    min: float | None = None
    max: float | None = None
    is_secret: bool = False
    description: str = ""
    is_required: bool = True
    """Whether a setting without a default must have a value before connecting."""
    group: str = ""
    """Title of the group on the settings page; "" means that the group depends on the setting's
    use."""

    @property
    def empty(self) -> Value:
        """Value of an empty setting in templates: None for numbers and booleans, otherwise ""."""
        return None if self.type in ("port", "integer", "number", "boolean") else ""

    def is_missing(self, value: Value) -> bool:
        """Return whether `value` is missing, so that the robot cannot connect.

        If the setting's default is empty text, empty text counts as a value.
        """
        return self.is_required and (value is None or (value == "" and self.default != ""))


Fed = str | bytes | Envelope
"""Test data: text in the connection's encoding, bytes, or an envelope."""


def pieces_of(fed: Fed | tuple[Fed, ...]) -> tuple[Fed, ...]:
    """Return the pieces of a test input; each piece arrives separately."""
    return (fed,) if isinstance(fed, (str, bytes, Envelope)) else fed


class ExpectedState(NamedTuple):
    """The expected state of a signal: value, alarm and age."""

    has_value: bool = False
    """Whether the test checks `value`."""
    value: Value | tuple[Value, ...] = None
    alarm: Alarm | None = None
    """Expected alarm of a signal; "" means no alarm, and None means any."""
    age: Literal["", "fresh", "stale", "never"] = ""
    """Expected age of a signal: fresh, stale or never received; "" means any."""


Expected = Value | tuple[Value, ...] | ExpectedState
"""Expected value of a signal, expected elements of an array, or expected state of a signal."""


class DialogueStep(NamedTuple):
    """One step of a test: at most one action, followed by the expected results."""

    line: int = 1
    """Line of the step in the document, 1-based."""
    column: int = 1
    """Column of the step in the document, 1-based."""
    source: str = ""
    """Source line of the step in the document, for error messages."""
    feed: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Input from the robot, keyed by transport."""
    run: str = ""
    """Name of the command to run."""
    arguments: Mapping[str, Reading] = NOTHING
    wait_s: float | None = None
    """Duration of a pause on the test's clock, in seconds."""
    connects: str = ""
    """Name of the transport whose connection opens in this step."""
    closes: str = ""
    """Name of the transport whose connection the robot closes."""
    leaves: bool = False
    """Whether the operator leaves the robot, so that all connections close in an orderly way."""
    sent: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """URC's expected output since the previous check, keyed by transport; () means no output."""
    expect: Mapping[str, Expected] = NOTHING
    reply: Mapping[str, Value | tuple[Value, ...]] | None = None
    """Expected reply values of the oldest completed command that no step has checked yet."""
    of: str = ""
    """Name of the command that `reply` or `fails` refers to; "" means any command."""
    fails: str = ""
    """Expected failure message."""
    closed: str = ""
    """Name of the transport that URC must have closed."""


class DocumentTest(NamedTuple):
    """A declared test of a document."""

    name: str
    line: int
    """Line of the test in the document, 1-based."""
    feed: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Input from the robot, keyed by transport, in one or more pieces; see `pieces_of`."""
    reply_to: int | str | None = None
    """Index of the poll, or name of the command, that is waiting for the reply."""
    run: str | None = None
    """Command to run."""
    arguments: Mapping[str, Reading] = NOTHING
    expect: Mapping[str, Expected] = NOTHING
    """Expected values after the test, keyed by signal."""
    sent: Mapping[str, "Fed | tuple[Fed, ...]"] = NOTHING
    """Expected output, keyed by transport: the exact payload without framing, or all bytes on the
    wire."""
    fails: str | None = None
    """Text that the failure message must contain; None means that the test expects success."""
    file: str = ""
    """Path of the document file."""
    column: int = 1
    """Column of the test in the document, 1-based."""
    source: str = ""
    """Source line of the test in the document, for error messages."""
    settings: Mapping[str, Value] = NOTHING
    """Setting values that differ from their defaults, keyed by setting."""
    steps: tuple[DialogueStep, ...] = ()
    """Steps of the test in order; () for a test without steps."""
    polls: tuple[str, ...] = ()
    """Names of the polls that run periodically during the steps."""
    is_ready: bool = False
    """Whether all connections are ready before the first step."""


class Reaction(NamedTuple):
    """One reaction of the emulated robot; the actions run in the order of the attributes."""

    after_s: float = 0.0
    """Delay after the previous reaction, in seconds."""
    until: Template | None = None
    """Condition for which the reaction waits; None means no condition."""
    sets: Mapping[str, Template | Reading] = NOTHING
    """New values, or templates for new values, keyed by signal or state variable."""
    answers: bool = False
    """Whether the robot sends the declared reply to the request."""
    refuses: bool = False
    """Whether the robot reports a failure to the request."""
    send: WriteSpec | None = None
    """Frame to send; None means no frame."""
    message: str = ""
    """Name of the message to send; "" means no message."""
    framing: FramingSpec | None = None
    """Framing of `send`; None means the framing of the request's reply, or of the connection."""
    closes: bool = False
    """Whether the robot closes the connection in this reaction."""


class SimulatorRule(NamedTuple):
    """A rule of the emulated robot, which applies to matching frames or at fixed intervals."""

    transport: str
    match: Pattern | ReadSpec | None = None
    """Pattern or form that a received frame must match; None means that `request` or `every_s`
    triggers the rule."""
    request: str = ""
    """Name of a command or poll; the rule matches its requests."""
    every_s: float | None = None
    """Period of a timed rule, in seconds; None means that the rule is not timed."""
    when: Template | None = None
    """Condition for the rule; the rule is inactive while the condition is false."""
    reactions: tuple[Reaction, ...] = (Reaction(),)
    name: str = ""
    """Name by which other documents can override the rule; "" means no name."""


class Profile(NamedTuple):
    """One robot, as declared in its documents; it can connect once its settings are complete."""

    name: str
    title: str
    file: str
    summary: str = ""
    settings: Mapping[str, Setting] = NOTHING
    driver: Driver = Driver()
    slots: Mapping[str, WidgetUse] = NOTHING
    """The driver's widgets, keyed by slot; an interface can override them."""
    interfaces: Mapping[str, Interface] = NOTHING
    """Interfaces by name; never empty, because the loader adds the interface ``default`` if it is
    missing."""
    widgets: Mapping[str, Widget] = NOTHING
    """All widgets of the profile, by name."""
    tests: tuple[DocumentTest, ...] = ()
    simulator: tuple[SimulatorRule, ...] = ()
    emulated: Mapping[str, Reading] = NOTHING
    """Initial values of the emulated robot, keyed by signal or state variable."""
    world: WorldSpec | None = None
    """Body and surroundings of the emulated robot; None means no world."""
    licence: str = ""
    """SPDX licence identifier from the document."""
    author: str = ""
    tags: tuple[str, ...] = ()
    """Tags that put the robot into groups, for which rights can be granted; at most 16, all
    different."""
    picture: str = ""
    """Path of the robot's picture; "" if there is no picture."""

    def uses(self) -> Iterator[WidgetUse]:
        """Yield each slot's widget, first from the driver and then from the interfaces."""
        yield from self.slots.values()
        for interface in self.interfaces.values():
            yield from interface.widgets.values()
