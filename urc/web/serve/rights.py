"""The right that each route needs, and the routes that check it before their endpoints.

Layer 5. The application has no other routes than `ProtectedRoute` and `ProtectedSocket`, as a
contract test checks, so no route lacks a right.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final, Literal, NamedTuple, Protocol

from starlette.exceptions import HTTPException
from starlette.routing import Route, WebSocketRoute
from starlette.types import Receive, Scope, Send

from urc.model.role import Role
from urc.web.wire.messages import CLOSE_NOT_LET_IN, encode_error
from urc.web.words import t

__all__ = [
    "ADMINISTER",
    "ADMINISTER_FRESH",
    "ANYONE",
    "DRIVE",
    "FRESH_S",
    "LOCAL",
    "MAINTAIN",
    "MAINTAIN_ANYWHERE",
    "MAINTAIN_FRESH",
    "MAINTAIN_SERVER",
    "MAINTAIN_SERVER_FRESH",
    "SIGNED_IN",
    "SIGNED_IN_FRESH",
    "WATCH",
    "ProtectedRoute",
    "ProtectedSocket",
    "Right",
    "RightHolder",
    "stale_text",
    "turn_away",
]


class Right(NamedTuple):
    """The right that a request needs."""

    role: Role | None
    """The least role; None: everyone, without a sign-in."""
    scope: Literal["robot", "server", "anywhere"] = "robot"
    """``robot``: at the robot of the path parameter ``name``. ``server``: for all robots.
    ``anywhere``: for at least one robot."""
    is_local: bool = False
    """Whether only the local user has the right."""
    is_fresh: bool = False
    """Whether people must have signed in within the last `FRESH_S` seconds."""

    @property
    def refusal(self) -> str:
        """The message to a visitor without the right."""
        if self.is_local:
            return t("This needs the key in the address that URC printed.")
        if self.scope == "server":
            return t("This needs the role {role} for all robots.", role=self.role)
        return t("This needs the role {role}.", role=self.role)


FRESH_S: Final = 300.0
"""Time after a sign-in in which people change packages, settings and rights, in seconds. A tablet
that was left signed in does not suffice."""
ANYONE: Final = Right(None)
SIGNED_IN: Final = Right("watch", "anywhere")
SIGNED_IN_FRESH: Final = Right("watch", "anywhere", is_fresh=True)
WATCH: Final = Right("watch")
DRIVE: Final = Right("drive")
MAINTAIN: Final = Right("maintain")
MAINTAIN_ANYWHERE: Final = Right("maintain", "anywhere")
MAINTAIN_SERVER: Final = Right("maintain", "server")
MAINTAIN_FRESH: Final = Right("maintain", is_fresh=True)
MAINTAIN_SERVER_FRESH: Final = Right("maintain", "server", is_fresh=True)
ADMINISTER: Final = Right("administer", "server")
ADMINISTER_FRESH: Final = Right("administer", "server", is_fresh=True)
LOCAL: Final = Right("administer", "server", is_local=True)


class RightHolder(Protocol):
    """The part of a visitor that routes use; see `urc.web.serve.visitor.Visitor`."""

    def may(self, right: Right, robot: str = "") -> bool:
        """Return whether the visitor has a right now."""

    @property
    def is_fresh(self) -> bool:
        """Whether the visitor has signed in within the last `FRESH_S` seconds."""


class ProtectedRoute(Route):
    """A route whose endpoint is called only for visitors with a right."""

    def __init__(
        self,
        path: str,
        endpoint: Callable[..., Any],
        right: Right,
        *,
        methods: Sequence[str] | None = None,
    ) -> None:
        super().__init__(path, endpoint, methods=methods)
        self.right = right

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Call the endpoint; raise `HTTPException` 403 without the right."""
        if not _may(scope, self.right):
            raise HTTPException(403, self.right.refusal)
        if self.right.is_fresh and not scope["state"]["visitor"].is_fresh:
            raise HTTPException(403, stale_text())
        await super().handle(scope, receive, send)


class ProtectedSocket(WebSocketRoute):
    """A route of sockets that are opened only for visitors with a right."""

    def __init__(self, path: str, endpoint: Callable[..., Any], right: Right) -> None:
        super().__init__(path, endpoint)
        self.right = right

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Call the endpoint, or close the socket with the reason."""
        if _may(scope, self.right):
            await super().handle(scope, receive, send)
        else:
            await turn_away(receive, send, self.right.refusal)


def stale_text() -> str:
    """Return the message to a visitor whose sign-in is too old."""
    minutes = round(FRESH_S / 60)
    return t("Sign in again: this needs a sign-in of the last {n} minutes.", n=minutes)


async def turn_away(receive: Receive, send: Send, reason: str) -> None:
    """Accept a socket and close it with the reason; a page cannot read a refused handshake."""
    await receive()
    await send({"type": "websocket.accept"})
    await send({"type": "websocket.send", "text": encode_error("refused", reason)})
    await send({"type": "websocket.close", "code": CLOSE_NOT_LET_IN, "reason": reason[:100]})


def _may(scope: Scope, right: Right) -> bool:
    if scope["state"].get("is_code"):
        return True  # the secret path of a frame's code, which sends no cookies
    visitor: RightHolder = scope["state"]["visitor"]
    robot = scope["path_params"].get("name", "") if right.scope == "robot" else ""
    return visitor.may(right, robot)
