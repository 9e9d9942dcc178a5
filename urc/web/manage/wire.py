"""What the managers' pages and the server say to each other: JSON, in camel case.

Floor 5. Pure. Requests are decoded into these, so what does not fit is refused in one line.
"""

from typing import Annotated, Any, Final, Literal

import msgspec

__all__ = [
    "MOST_HITS",
    "Add",
    "Agree",
    "Ask",
    "Available",
    "Failure",
    "Gone",
    "Healthy",
    "Installed",
    "JobNews",
    "JobState",
    "Line",
    "Message",
    "Package",
    "Place",
    "SettingsAnswer",
    "SettingsAsked",
    "Shelf",
    "Started",
    "Stopped",
    "TapeAsked",
    "TapeState",
    "Timeline",
    "TriedLine",
    "Url",
]

MOST_HITS: Final = 100
"""Packages that one search shows."""

_Short = Annotated[str, msgspec.Meta(max_length=300)]
_Long = Annotated[str, msgspec.Meta(max_length=4096)]
_Settings = Annotated[dict[_Short, _Long | None], msgspec.Meta(max_length=200)]


class Message(msgspec.Struct, frozen=True, rename="camel", forbid_unknown_fields=True):
    """Anything that is said here."""


class Url(Message, frozen=True):
    """A repository is connected to, or forgotten."""

    url: _Short


class Ask(Message, frozen=True):
    """The repositories are asked what they have."""

    force: bool = False
    """However new their answers are."""


class Package(Message, frozen=True):
    """A package is asked for: ``drivers/puppet`` or ``drivers/puppet@1.0.0``."""

    package: _Short
    yes: bool = False
    """Of a removal: do it; else only say what would go."""
    forget: bool = True
    """Of a removal: also of what was filled in for the robot, secrets among it."""


class Add(Message, frozen=True):
    """A package is added by its path: in a repository, or on this machine."""

    path: _Long


class Agree(Message, frozen=True):
    """What a job may do was read and agreed to; or the job is given up."""

    number: int
    takes_risks: bool = False
    """Whether what the package uses of this machine by itself was agreed to as well."""


JobState = Literal["working", "asks", "done", "failed", "cancelled"]


class JobNews(Message, frozen=True):
    """Where the one job stands that there is at a time."""

    number: int
    title: str
    state: JobState
    line: str
    """What it does, or what became of it, in one line."""
    done: int
    of: int
    """Steps; 0 while nobody knows."""
    is_update: bool = False
    packages: tuple[str, ...] = ()
    """Where each package comes from, and who signed it; of an update what becomes of each."""
    may: tuple[str, ...] = ()
    """What the package may do, one line each."""
    risks: tuple[str, ...] = ()
    """What of this machine it uses by itself; of an update only what is new."""
    gained: tuple[str, ...] = ()
    """Of an update: what it may do that the version before may not."""
    lost: tuple[str, ...] = ()
    wire: tuple[str, ...] = ()
    """Of an update: what changes in what goes to the robot."""
    stays: str = ""
    """The version that is in use, and stays so until another one is chosen; "": none does."""
    notes: tuple[str, ...] = ()
    """What should be known beside, as a repository that did not answer."""


class Place(Message, frozen=True):
    """A repository."""

    url: str
    name: str
    count: int
    """Versions of packages that it has."""
    fault: str
    """Why it could not be asked; "" when it was."""
    is_kept: bool
    """What it said before is used."""
    is_plain: bool
    """It is reached without encryption."""
    keeper: str = ""
    """Who signs its index, with the fingerprint of the key; "" for nobody."""


class Installed(Message, frozen=True):
    """An installed package that was asked for by itself."""

    package: str
    name: str
    kind: str
    version: str
    summary: str
    licence: str
    authors: tuple[str, ...]
    brings: tuple[str, ...]
    """All that came along with it, as ``widgets/dial 1.0.0``."""
    newer: str
    """A version that a repository has; "" when there is none."""
    before: str
    """The version that an update took the place of; "" when there is none to go back to."""
    url: str
    """Of its page; "" where it has none."""
    settings_url: str
    fits: tuple[str, ...]
    """Of an interface: titles of the robots that offer it."""
    fault: str
    """Why it cannot be used; "" when it can."""
    withdrawn: tuple[str, ...] = ()
    """What its repository offers no more, of it and of what came along, and why; one line each."""


class Available(Message, frozen=True):
    """A package of a repository."""

    package: str
    name: str
    kind: str
    version: str
    versions: tuple[str, ...]
    """All, the newest first."""
    summary: str
    licence: str
    authors: tuple[str, ...]
    origin: str
    size: int
    has: str
    """The version that is installed; "" for none."""


class Shelf(Message, frozen=True):
    """All that a manager's page shows."""

    repositories: tuple[Place, ...]
    installed: tuple[Installed, ...]
    available: tuple[Available, ...]
    total: int
    """Packages that were found; at most `MOST_HITS` are told."""
    is_asking: bool
    """The repositories are being asked."""
    may_manage: bool
    job: JobNews | None


class Line(Message, frozen=True):
    """What was done, in one line."""

    line: str


class Gone(Message, frozen=True):
    """What went, or would go."""

    gone: tuple[str, ...]
    """As ``drivers/puppet 1.0.0``."""
    line: str
    has_settings: bool = False
    """Whether something was filled in for it, which may be forgotten."""


class Failure(Message, frozen=True):
    """Why something was not done."""

    error: str
    """One line."""


class Healthy(Message, frozen=True):
    """The server runs."""

    status: str
    version: str


class Stopped(Message, frozen=True):
    """A robot was told to stop."""

    latched: str
    """Who stopped it."""
    confirmed: bool
    """Whether the stop was handed to the robot's line."""


class ControlState(Message, frozen=True):
    """Who drives a robot, and who stopped it."""

    holder: str
    """The screen that has the controls; "" where none has."""
    latched: str
    """Who pressed STOP; "" while nothing is latched."""
    emulated: bool
    """It only has the name of a real robot: it is emulated, or a recording."""


class TapeAsked(Message, frozen=True):
    """A recording is to be moved; what is left out stays as it is."""

    position_s: float | None = None
    is_playing: bool | None = None


class TapeState(Message, frozen=True):
    """Where a recording stands."""

    began_s: float
    """When it was recorded, in seconds since 1970."""
    length_s: float
    position_s: float
    is_playing: bool
    speed: float
    """How many seconds of it pass in one."""


class Timeline(Message, frozen=True):
    """What made a robot move."""

    entries: list[dict[str, Any]]
    fault: str
    """Why no more is kept; "" when it is."""


class Started(Message, frozen=True):
    """A robot's documents were read anew."""

    line: str
    url: str
    """Of its page."""


class SettingsAsked(Message, frozen=True):
    """What was filled in for a robot."""

    settings: _Settings = {}
    """Setting → as typed; None leaves a secret as it is."""
    version: _Short = ""
    interface: _Short = ""
    test: bool = True
    """Whether the robot is tried."""
    anyway: bool = False
    """Whether it is saved even when the robot could not be reached."""


class TriedLine(Message, frozen=True):
    """What became of one transport in a test."""

    transport: str
    type: str
    address: str
    verdict: str
    text: str
    advice: str


class SettingsAnswer(Message, frozen=True):
    """What became of it."""

    is_saved: bool
    text: str
    faults: dict[str, str] = {}
    """Setting → what is wrong with it, in one line."""
    missing: tuple[str, ...] = ()
    """Titles of settings that have no value."""
    lines: tuple[TriedLine, ...] = ()
