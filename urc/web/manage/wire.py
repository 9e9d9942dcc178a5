"""JSON messages between the manager pages and the server, with field names in camel case.

Layer 5. Pure. The server decodes requests into these types and refuses an invalid request with one
line of text.
"""

from typing import Annotated, Any, Final, Literal

import msgspec

__all__ = [
    "MOST_HITS",
    "Add",
    "JobDecision",
    "RefreshRequest",
    "AuditResult",
    "Available",
    "FoundTopic",
    "NewRobot",
    "NewRobotAdded",
    "TopicsAsked",
    "TopicsFound",
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
    "ProbedTransport",
    "Url",
]

MOST_HITS: Final = 100
"""Maximum number of packages in a search result."""

_Short = Annotated[str, msgspec.Meta(max_length=300)]
_Long = Annotated[str, msgspec.Meta(max_length=4096)]
_Port = Annotated[int, msgspec.Meta(ge=1, le=65535)]
_Topic = Annotated[str, msgspec.Meta(max_length=256, pattern="^[A-Za-z0-9_/]*$")]
_Settings = Annotated[dict[_Short, _Long | None], msgspec.Meta(max_length=200)]


class ManageMessage(msgspec.Struct, frozen=True, rename="camel", forbid_unknown_fields=True):
    """The base class of all messages in this module."""


class Url(ManageMessage, frozen=True):
    """Request to add or remove a repository."""

    url: _Short


class TopicsAsked(ManageMessage, frozen=True):
    """Request for the topics of the ROS robot at an address."""

    host: Annotated[str, msgspec.Meta(min_length=1, max_length=253)]
    port: _Port | None = None
    """Port of the bridge or router; None to try the usual ports."""


class FoundTopic(ManageMessage, frozen=True):
    """One topic and its type in the short form ``pkg/Type``; "" for an unknown type."""

    name: str
    type: str


class TopicsFound(ManageMessage, frozen=True):
    """The topics of a ROS robot that fit the parts of a mobile base."""

    via: str
    """Kind of the connection: ``rosbridge``, ``foxglove`` or ``zenoh``."""
    port: int
    version: int
    """ROS version, 1 or 2."""
    total: int
    """Number of all topics of the robot."""
    parts: dict[str, tuple[FoundTopic, ...]]
    """Topics that fit each part, best first, keyed by part."""


class NewRobot(ManageMessage, frozen=True):
    """Request to add a ROS robot."""

    title: Annotated[str, msgspec.Meta(max_length=80)]
    host: Annotated[str, msgspec.Meta(min_length=1, max_length=253)]
    port: _Port
    via: Literal["rosbridge", "foxglove", "zenoh"]
    version: Literal[1, 2]
    command_type: Literal["geometry_msgs/Twist", "geometry_msgs/TwistStamped"]
    """Type of the messages that the robot's command topic takes."""
    topics: Annotated[dict[_Short, _Topic], msgspec.Meta(max_length=20)]
    """Topic of each part that the robot has, keyed by part."""


class NewRobotAdded(ManageMessage, frozen=True):
    """The new robot's name and the path of its page."""

    name: str
    url: str


class RefreshRequest(ManageMessage, frozen=True):
    """Request to refresh the package lists."""

    force: bool = False
    """Whether to refresh the lists even if they are recent."""


class InstallRequest(ManageMessage, frozen=True):
    """Request about a package, such as ``drivers/puppet`` or ``drivers/puppet@1.0.0``."""

    package: _Short
    yes: bool = False
    """Whether to remove the packages; if false, the server only lists what would be removed."""
    forget: bool = True
    """Whether a removal also deletes the robot's settings and secrets."""


class Add(ManageMessage, frozen=True):
    """Request to add a package by its path in a repository or on this machine."""

    path: _Long


class JobDecision(ManageMessage, frozen=True):
    """Approval or cancellation of a job after the user has seen the permissions."""

    number: int
    takes_risks: bool = False
    """Whether the user also approved everything in the job's `risks`."""
    unsigned: Annotated[tuple[_Short, ...], msgspec.Meta(max_length=128)] = ()
    """Unsigned packages that the user accepts, such as ``widgets/dial``."""


JobState = Literal["working", "asks", "done", "failed", "cancelled"]


class JobNews(ManageMessage, frozen=True):
    """State of the newest job."""

    number: int
    title: str
    state: JobState
    line: str
    """The job's current activity or result, in one line."""
    done: int
    of: int
    """Number of downloads in the job; 0 while the number is unknown."""
    is_update: bool = False
    packages: tuple[str, ...] = ()
    """Origin and signer of each package; for an update, the changed versions."""
    may: tuple[str, ...] = ()
    """Permissions of the package, one per line."""
    risks: tuple[str, ...] = ()
    """Files, programs and hosts that the package uses without a setting, one per line; for an
    update, only additional ones."""
    unsigned: tuple[str, ...] = ()
    """Packages without the required signature, such as ``widgets/dial``. The user must approve each
    package by name."""
    gained: tuple[str, ...] = ()
    """Permissions of the new version that the installed version does not have."""
    lost: tuple[str, ...] = ()
    wire: tuple[str, ...] = ()
    """Changes that the update makes to the frames sent to the robot."""
    stays: str = ""
    """Version that stays in use until the user chooses another version; "" if the new version is
    used."""
    notes: tuple[str, ...] = ()
    """Further notes, for example about a repository that does not respond."""


class RepositoryInfo(ManageMessage, frozen=True):
    """A repository."""

    url: str
    name: str
    count: int
    """Number of package versions in the repository."""
    fault: str
    """Reason why the last request failed; "" if it succeeded."""
    is_kept: bool
    """Whether the repository's cached list is shown, because the last request failed."""
    is_plain: bool
    """Whether the connection to the repository is unencrypted."""
    keeper: str = ""
    """Signer of the repository's index, with the key's fingerprint; "" for an unsigned index."""


class Installed(ManageMessage, frozen=True):
    """A package that was installed directly, not only as a dependency."""

    package: str
    name: str
    kind: str
    version: str
    summary: str
    licence: str
    authors: tuple[str, ...]
    brings: tuple[str, ...]
    """Dependencies of the package, such as ``widgets/dial 1.0.0``."""
    newer: str
    """Newer version in a repository; "" if this version is the newest."""
    before: str
    """Earlier version that can be restored; "" if there is no such version."""
    url: str
    """URL of the package's page; "" if it has no page."""
    settings_url: str
    fits: tuple[str, ...]
    """Titles of robots that offer the interface."""
    fault: str
    """Reason why the package cannot be used; "" if it can."""
    withdrawn: tuple[str, ...] = ()
    """Withdrawn packages with reasons, one per line, including dependencies of the package."""


class Available(ManageMessage, frozen=True):
    """A package that a repository offers."""

    package: str
    name: str
    kind: str
    version: str
    versions: tuple[str, ...]
    """All offered versions, newest first."""
    summary: str
    licence: str
    authors: tuple[str, ...]
    origin: str
    size: int
    has: str
    """Installed version; "" if the package is not installed."""


class PackageList(ManageMessage, frozen=True):
    """All package lists on a manager page."""

    repositories: tuple[RepositoryInfo, ...]
    installed: tuple[Installed, ...]
    available: tuple[Available, ...]
    total: int
    """Number of packages found; the list contains at most `MOST_HITS` of them."""
    is_asking: bool
    """Whether a refresh is running."""
    may_manage: bool
    job: JobNews | None


class ResultLine(ManageMessage, frozen=True):
    """The result of a request, as one line of text for the user."""

    line: str


class RemovedPackages(ManageMessage, frozen=True):
    """Packages that a request removes, or would remove."""

    gone: tuple[str, ...]
    """Names and versions, such as ``drivers/puppet 1.0.0``."""
    line: str
    has_settings: bool = False
    """Whether the robot has stored settings, which the removal may delete."""


class HealthStatus(ManageMessage, frozen=True):
    """Response of the health check."""

    status: str
    version: str


class StopResult(ManageMessage, frozen=True):
    """Result of a STOP request."""

    latched: str
    """Name of the operator whose STOP is latched."""
    confirmed: bool
    """Whether all the robot's transports have accepted the stop, and the robot has answered all
    cancellations of goals."""


class ControlState(ManageMessage, frozen=True):
    """The holder of a robot's lease, and the state of its STOP latch."""

    holder: str
    """Name of the operator in control; "" if no operator is in control."""
    latched: str
    """Name of the operator who pressed STOP; "" while STOP is not latched."""
    emulated: bool
    """Whether the robot is emulated, or is the playback of a recording."""


class PlaybackRequest(ManageMessage, frozen=True):
    """Request to change a playback; omitted fields stay unchanged."""

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


class AuditResult(ManageMessage, frozen=True):
    """Entries of the audit log, newest first."""

    entries: list[dict[str, Any]]
    """Values of each entry, keyed by column; the column ``id`` is the entry's number."""
    fault: str
    """Reason why the audit log can no longer be written; "" if it can."""
    has_more: bool
    """Whether older entries may exist; use the parameter ``before`` to request them."""


class ReloadResult(ManageMessage, frozen=True):
    """Result of reloading a robot's documents."""

    line: str
    url: str
    """URL of the robot's page."""


class SettingsAsked(ManageMessage, frozen=True):
    """A robot's settings, as submitted by the page."""

    settings: _Settings = {}
    """Entered text of each setting, keyed by name; null leaves a secret unchanged."""
    version: _Short = ""
    interface: _Short = ""
    test: bool = True
    """Whether to test the connection before saving."""
    anyway: bool = False
    """Whether to save the settings even if the connection test fails."""
    monitors_alarms: bool | None = None
    """Whether the robot stays connected for its alarms; null for the server's default."""


class ProbedTransport(ManageMessage, frozen=True):
    """Result of one transport's connection test."""

    transport: str
    type: str
    address: str
    verdict: str
    text: str
    advice: str
    cause: str = ""
    """Name of the failure's cause; "" if the cause is unknown."""
    field: str = ""
    """Setting that most likely caused the failure, or that holds the address of a transport that
    answers; "" if this setting is unknown."""


class SettingsAnswer(ManageMessage, frozen=True):
    """Result of a request to test, store and apply settings."""

    is_saved: bool
    text: str
    faults: dict[str, str] = {}
    """One-line error for each invalid setting, keyed by setting name."""
    missing: tuple[str, ...] = ()
    """Titles of required settings without a value."""
    lines: tuple[ProbedTransport, ...] = ()
