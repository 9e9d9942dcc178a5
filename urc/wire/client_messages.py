"""The shapes of client messages, identified by their tag ``t``.

Layer 3½. Pure. `urc.client` encodes these messages, and `urc.web.wire` decodes them. The types
limit the nesting: the decoder refuses any value nested more deeply than a map of plain arguments.
"""

from collections.abc import Mapping
from typing import Annotated, Final, Literal

import msgspec

from urc.model.role import Role
from urc.motion.lease import REQUEST_S
from urc.protocol.sequences.sequence_control import Pull

__all__ = [
    "RIGHTS",
    "INBOUND_BYTES",
    "Arguments",
    "ClientMessage",
    "Doubled",
    "Driving",
    "Verb",
    "Ping",
    "CommandRequest",
    "ImageSelection",
    "Approval",
    "ApprovalRequest",
    "SequenceAction",
    "GoalDismissal",
    "SCREEN_NAME_LENGTH",
    "ScreenName",
    "Reconnect",
    "Drive",
    "Tick",
    "Release",
    "Stop",
    "JoinPictures",
    "JoinRedundant",
]

INBOUND_BYTES = 64 * 1024
"""Maximum length of a message from a client, in bytes."""
SCREEN_NAME_LENGTH: Final = 40
"""Maximum length of a screen name, in characters."""

_Scalar = bool | int | float | str
Arguments = dict[str, bool | int | float | str | tuple[_Scalar, ...] | None]
"""Arguments of a command, as sent by the client."""
Verb = Literal["take", "ask", "yes", "no", "force", "leave", "reset", "override"]
"""Kind of a request about the lease. ``reset`` resets a latched STOP. ``override`` permits the
holder to drive without an image for a moment."""


class Ping(msgspec.Struct, tag_field="t", tag="ping", forbid_unknown_fields=True, frozen=True):
    """A request for a `pong` with the same `c`, which is the page's time in milliseconds."""

    c: float


class CommandRequest(
    msgspec.Struct, tag_field="t", tag="run", forbid_unknown_fields=True, frozen=True
):
    """One command. The page chooses `id`, and exactly one reply contains the same `id`."""

    id: int
    command: str
    arguments: Arguments = {}
    token: str = ""
    """Token from `ApprovalRequest`, if the driver requires a confirmation."""
    stops: int | None = None
    """Number of STOPs known to the page when the operator clicked; None skips the check."""


class ImageSelection(
    msgspec.Struct, tag_field="t", tag="show", forbid_unknown_fields=True, frozen=True
):
    """The signals whose images the page shows; the server sends no other images."""

    signals: Annotated[
        tuple[Annotated[str, msgspec.Meta(max_length=256)], ...], msgspec.Meta(max_length=64)
    ] = ()
    stills: Annotated[
        tuple[Annotated[str, msgspec.Meta(max_length=256)], ...], msgspec.Meta(max_length=64)
    ] = ()
    """The videos among `signals` that the page cannot decode; the server sends JPEG images."""
    apart: bool = False
    """Whether the images come only over the socket for images, which the page opens."""


class Approval(msgspec.Struct, tag_field="t", tag="agree", forbid_unknown_fields=True, frozen=True):
    """A second person's answer to question `n`; the asking page sends False to withdraw it."""

    n: int
    yes: bool


class ApprovalRequest(
    msgspec.Struct, tag_field="t", tag="prepare", forbid_unknown_fields=True, frozen=True
):
    """The operator's confirmation of a command with these arguments; the reply has a `token`."""

    id: int
    command: str
    arguments: Arguments = {}
    stops: int | None = None
    """Number of STOPs known to the page. The server checks only the number in
    `CommandRequest`."""


class SequenceAction(
    msgspec.Struct, tag_field="t", tag="steer", forbid_unknown_fields=True, frozen=True
):
    """A request to pause, step, resume or end a sequence."""

    command: str
    verb: Pull


class GoalDismissal(
    msgspec.Struct, tag_field="t", tag="dismiss", forbid_unknown_fields=True, frozen=True
):
    """A person's statement that a lost goal, with the number in `GoalRow`, has ended."""

    goal: int


class ScreenName(
    msgspec.Struct, tag_field="t", tag="name", forbid_unknown_fields=True, frozen=True
):
    """The name of a screen that does not have its own sign-in, such as “Tablet in the lab”."""

    name: Annotated[str, msgspec.Meta(max_length=SCREEN_NAME_LENGTH)] = ""
    """"" resets the name to the screen's number."""


class Reconnect(
    msgspec.Struct, tag_field="t", tag="reconnect", forbid_unknown_fields=True, frozen=True
):
    """A request to reopen the robot's lost connections without waiting for the backoff."""


class Drive(
    msgspec.Struct,
    tag_field="t",
    tag="drive",
    forbid_unknown_fields=True,
    omit_defaults=True,
    frozen=True,
):
    """A request about the lease."""

    verb: Verb
    for_s: float = REQUEST_S
    """Time that the holder has to answer, or the duration of an override, in seconds."""
    stops: int | None = None
    """Number of STOPs known to the page. A reset is refused if STOP has been pressed again since
    then; null means the current number."""


class Tick(
    msgspec.Struct,
    tag_field="t",
    tag="tick",
    forbid_unknown_fields=True,
    omit_defaults=True,
    frozen=True,
):
    """One sample of a held control. See `urc.motion.freshness.ControlInput`."""

    command: str
    epoch: int
    number: int
    echo: int
    arguments: Arguments = {}
    sees: tuple[int, int] | None = None
    """The shown image of the signal that the command requires. The first item is the number in the
    image's message. The second is for how long the page has shown the image, in milliseconds.
    Without `sees`, the page counts as blind; see `urc.motion.driving_lock`."""


class Release(
    msgspec.Struct, tag_field="t", tag="release", forbid_unknown_fields=True, frozen=True
):
    """The release of a held control.

    Releases and ticks share one sequence of numbers: after a release, ticks with lower numbers have
    no effect. A program that sends ticks and releases in order may send 0 as the number.
    """

    command: str
    number: int = 0


class Stop(msgspec.Struct, tag_field="t", tag="stop", forbid_unknown_fields=True, frozen=True):
    """A press of STOP; `number` has the meaning that it has in `Release`."""

    number: int = 0


class JoinRedundant(
    msgspec.Struct, tag_field="t", tag="spare", forbid_unknown_fields=True, frozen=True
):
    """The first message on a redundant socket, with the key from the page's lease."""

    key: str


class JoinPictures(
    msgspec.Struct, tag_field="t", tag="pictures", forbid_unknown_fields=True, frozen=True
):
    """The first message on a socket for images, with the key from the page's `HelloMessage`."""

    key: str


Driving = Drive | Tick | Release | Stop
"""Messages that drive the robot: lease requests, ticks, releases and STOP."""
Doubled = Tick | Release | Stop
"""Messages that a page may also send over its redundant socket."""
ClientMessage = (
    Ping
    | CommandRequest
    | ImageSelection
    | Approval
    | ApprovalRequest
    | SequenceAction
    | GoalDismissal
    | ScreenName
    | Reconnect
    | Drive
    | Tick
    | Release
    | Stop
)
"""Every message that a client may send over its main socket."""

RIGHTS: Final[Mapping[type, Role | None]] = {
    Ping: "watch",
    ImageSelection: "watch",
    CommandRequest: "drive",
    ApprovalRequest: "drive",
    Approval: "drive",
    SequenceAction: "drive",
    GoalDismissal: "drive",
    ScreenName: "watch",
    Reconnect: "watch",
    Drive: "drive",
    Tick: "drive",
    Release: "drive",
    Stop: None,
}
"""Lowest role that may send each message; None allows every page to send it. A
command may require a higher role (see `urc.model.driver.Command`). Taking the controls by force
requires ``maintain``."""
