"""Messages between the managers' pages and the server: JSON, in camel case.

Layer 5. Pure. Requests are decoded into these types; a mismatch is refused with one line.
"""

from typing import Annotated, Any, Final, Literal

import msgspec

__all__ = [
    "MOST_HITS",
    "Add",
    "JobDecision",
    "RefreshRequest",
    "Available",
    "Failure",
    "RemovedPackages",
    "HealthStatus",
    "Installed",
    "JobNews",
    "JobState",
    "ResultLine",
    "ManageMessage",
    "InstallRequest",
    "RepositoryInfo",
    "SettingsAnswer",
    "SettingsAsked",
    "PackageList",
    "ReloadResult",
    "StopResult",
    "PlaybackRequest",
    "PlaybackState",
    "Timeline",
    "ProbedTransport",
    "Url",
]

MOST_HITS: Final = 100
"""Most packages in the result of a search."""

_Short = Annotated[str, msgspec.Meta(max_length=300)]
_Long = Annotated[str, msgspec.Meta(max_length=4096)]
_Settings = Annotated[dict[_Short, _Long | None], msgspec.Meta(max_length=200)]


class ManageMessage(msgspec.Struct, frozen=True, rename="camel", forbid_unknown_fields=True):
    """Base of all messages of this module."""


class Url(ManageMessage, frozen=True):
    """Request to add or remove a repository."""

    url: _Short


class RefreshRequest(ManageMessage, frozen=True):
    """Request to refresh the package lists from the repositories."""

    force: bool = False
    """Whether to ignore the age of the last refresh."""


class InstallRequest(ManageMessage, frozen=True):
    """Request about a package: ``drivers/puppet`` or ``drivers/puppet@1.0.0``."""

    package: _Short
    yes: bool = False
    """Whether to perform a removal; else it is only listed."""
    forget: bool = True
    """Whether a removal also deletes the settings of the robot, with its secrets."""


class Add(ManageMessage, frozen=True):
    """Request to add a package by its path: in a repository, or on this machine."""

    path: _Long


class JobDecision(ManageMessage, frozen=True):
    """Approval or cancellation of a job, after its permissions were shown."""

    number: int
    takes_risks: bool = False
    """Whether the user also approved the package's own access to this machine."""


JobState = Literal["working", "asks", "done", "failed", "cancelled"]


class JobNews(ManageMessage, frozen=True):
    """State of the current job."""

    number: int
    title: str
    state: JobState
    line: str
    """Current activity or result, in one line."""
    done: int
    of: int
    """Number of steps; 0 while unknown."""
    is_update: bool = False
    packages: tuple[str, ...] = ()
    """Origin and signer of each package; for an update, the change of each."""
    may: tuple[str, ...] = ()
    """Permissions of the package, one a line."""
    risks: tuple[str, ...] = ()
    """Access of the package itself to this machine; for an update, only new access."""
    gained: tuple[str, ...] = ()
    """Permissions that an update adds."""
    lost: tuple[str, ...] = ()
    wire: tuple[str, ...] = ()
    """Changes in the frames to the robot, for an update."""
    stays: str = ""
    """Version that stays in use until the user chooses another one, or ""."""
    notes: tuple[str, ...] = ()
    """Further notes, for example about a repository that did not respond."""


class RepositoryInfo(ManageMessage, frozen=True):
    """A repository."""

    url: str
    name: str
    count: int
    """Number of package versions in it."""
    fault: str
    """Why the last request failed, or ""."""
    is_kept: bool
    """Whether its cached list is in use."""
    is_plain: bool
    """Whether it is reached without encryption."""
    keeper: str = ""
    """Signer of its index, with the fingerprint of the key; "" if it is unsigned."""


class Installed(ManageMessage, frozen=True):
    """A package that a user installed, and no mere dependency."""

    package: str
    name: str
    kind: str
    version: str
    summary: str
    licence: str
    authors: tuple[str, ...]
    brings: tuple[str, ...]
    """Dependencies of the package, as ``widgets/dial 1.0.0``."""
    newer: str
    """Newer version in a repository, or ""."""
    before: str
    """Version before the update, or "" if none can be restored."""
    url: str
    """URL of its page, or ""."""
    settings_url: str
    fits: tuple[str, ...]
    """Titles of the robots that offer this interface."""
    fault: str
    """Why it cannot be used, or ""."""
    withdrawn: tuple[str, ...] = ()
    """Withdrawn packages among it and its dependencies, with the reason; one a line."""


class Available(ManageMessage, frozen=True):
    """A package of a repository."""

    package: str
    name: str
    kind: str
    version: str
    versions: tuple[str, ...]
    """All versions, newest first."""
    summary: str
    licence: str
    authors: tuple[str, ...]
    origin: str
    size: int
    has: str
    """Installed version, or ""."""


class PackageList(ManageMessage, frozen=True):
    """All lists of a manager's page."""

    repositories: tuple[RepositoryInfo, ...]
    installed: tuple[Installed, ...]
    available: tuple[Available, ...]
    total: int
    """Packages that were found; the lists have at most `MOST_HITS`."""
    is_asking: bool
    """Whether a refresh is running."""
    may_manage: bool
    job: JobNews | None


class ResultLine(ManageMessage, frozen=True):
    """Result of an action, in one line."""

    line: str


class RemovedPackages(ManageMessage, frozen=True):
    """Packages that a removal removes."""

    gone: tuple[str, ...]
    """Names as ``drivers/puppet 1.0.0``."""
    line: str
    has_settings: bool = False
    """Whether it has settings, which the removal may delete."""


class Failure(ManageMessage, frozen=True):
    """Error response: why a request failed."""

    error: str
    """The reason, in one line."""


class HealthStatus(ManageMessage, frozen=True):
    """Response of the health check."""

    status: str
    version: str


class StopResult(ManageMessage, frozen=True):
    """Result of a STOP."""

    latched: str
    """Name of the operator who pressed STOP."""
    confirmed: bool
    """Whether the robot's transports have taken the stop."""


class ControlState(ManageMessage, frozen=True):
    """The holder of the lease, and the state of STOP."""

    holder: str
    """Name of the page that drives, or ""."""
    latched: str
    """Name of the operator who pressed STOP; "" while nothing is latched."""
    emulated: bool
    """Whether the robot is emulated or a playback."""


class PlaybackRequest(ManageMessage, frozen=True):
    """Request to change the playback; fields that are left out stay as they are."""

    position_s: float | None = None
    is_playing: bool | None = None


class PlaybackState(ManageMessage, frozen=True):
    """State of a playback."""

    began_s: float
    """Start time of the recording, in seconds since 1970."""
    length_s: float
    position_s: float
    is_playing: bool
    speed: float
    """Playback speed; 1 is real time."""


class Timeline(ManageMessage, frozen=True):
    """Audit log of a robot's motion."""

    entries: list[dict[str, Any]]
    fault: str
    """Why the log is no longer written, or ""."""


class ReloadResult(ManageMessage, frozen=True):
    """Result of a reload of a robot's documents."""

    line: str
    url: str
    """URL of its page."""


class SettingsAsked(ManageMessage, frozen=True):
    """The submitted settings of a robot."""

    settings: _Settings = {}
    """Setting → typed text; None leaves a secret as it is."""
    version: _Short = ""
    interface: _Short = ""
    test: bool = True
    """Whether to test the connection."""
    anyway: bool = False
    """Whether to save even if the test fails."""


class ProbedTransport(ManageMessage, frozen=True):
    """Test result of one transport."""

    transport: str
    type: str
    address: str
    verdict: str
    text: str
    advice: str


class SettingsAnswer(ManageMessage, frozen=True):
    """Result of a submission of settings."""

    is_saved: bool
    text: str
    faults: dict[str, str] = {}
    """Setting → its mistake, in one line."""
    missing: tuple[str, ...] = ()
    """Titles of settings that have no value."""
    lines: tuple[ProbedTransport, ...] = ()
