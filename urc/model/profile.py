"""A robot profile: one robot, its settings, its driver, its interfaces, its own tests."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from urc.expressions import Template
from urc.model.driver import Driver
from urc.model.interface import Interface, WidgetUse
from urc.model.values import NOTHING, Value
from urc.model.widget import Widget
from urc.patterns import Pattern

__all__ = ["DocumentTest", "Fed", "Profile", "Setting", "SimulatorRule", "pieces_of"]


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


Fed = str | bytes
"""Text in the line's encoding, or bytes."""


def pieces_of(fed: Fed | tuple[Fed, ...]) -> tuple[Fed, ...]:
    """Return what is fed, piece by piece: each comes by itself."""
    return fed if isinstance(fed, tuple) else (fed,)


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
    arguments: Mapping[str, Value] = NOTHING
    expect: Mapping[str, Value | tuple[Value, ...]] = NOTHING
    """Signal → value after it; of an array, all its elements."""
    sent: Mapping[str, Fed] = NOTHING
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


class SimulatorRule(NamedTuple):
    """What the emulated robot does with a frame that matches, or every so often."""

    transport: str
    pattern: Pattern | None
    """None: a rule that is driven by `every_s` alone."""
    send: Template | None
    """None: takes the frame and says nothing."""
    every_s: float | None = None


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
    licence: str = ""
    """SPDX identifier, as the document says."""
    author: str = ""
