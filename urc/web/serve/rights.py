"""The right that each route requires, and route classes that check it before calling the endpoint.

Layer 5. Every route of the application is a `ProtectedRoute` or `ProtectedSocket`, so every route
has a right. A contract test checks this rule.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final, Literal, NamedTuple, Protocol

from starlette.exceptions import HTTPException
from starlette.routing import Route, WebSocketRoute
from starlette.types import Receive, Scope, Send

from urc.model.role import Role
from urc.web.wire.messages import CLOSE_NOT_LET_IN, encode_error
from urc.web.wire.text import close_reason
from urc.web.words import t
from urc.wire.foxglove import chosen_subprotocol, encode_status

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
    "SITE",
    "WATCH",
    "ProtectedRoute",
    "ProtectedSocket",
    "Right",
    "RightHolder",
    "stale_text",
    "turn_away",
]


class Right(NamedTuple):
    """The right required for a request."""

    role: Role | None
    """Minimum role; None permits everyone, even without a sign-in."""
    scope: Literal["robot", "server", "anywhere"] = "robot"
    """Robots for which the role is required. ``robot`` means the robot in the path parameter
    ``name``, ``server`` all robots, and ``anywhere`` at least one robot."""
    is_local: bool = False
    """Whether only the local user has the right."""
    is_fresh: bool = False
    """Whether people must have signed in within the last `FRESH_S` seconds."""
    is_site: bool = False
    """Whether only other sites of the fleet have the right, for any visitor there."""

    @property
    def refusal(self) -> str:
        """The refusal message for visitors without the right."""
        if self.is_site:
            return t("This is for other sites of the fleet.")
        if self.is_local:
            return t("This needs the start key: open the address that URC printed.")
        if self.scope == "server":
            return t("This needs the role {role} for all robots.", role=self.role)
        return t("This needs the role {role}.", role=self.role)


FRESH_S: Final = 300.0
"""Time after a sign-in, in seconds, during which people can change packages, settings and rights.
After this time, a tablet that was left signed in no longer permits such changes."""
ANYONE: Final = Right(None)
SITE: Final = Right(None, "server", is_site=True)
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
    """The rights of a visitor, as routes check them; see `urc.web.serve.visitor.Visitor`."""

    def may(self, right: Right, robot: str = "") -> bool:
        """Return whether the visitor currently has a right."""

    def limit(self, robot: str) -> str:
        """Return why this site limits the visitor's role for a robot; "" if it does not."""

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
        """Call the endpoint; raise `HTTPException` 403 for visitors without the right."""
        if not _may(scope, self.right):
            raise HTTPException(403, _refusal(scope, self.right))
        if self.right.is_fresh and not scope["state"]["visitor"].is_fresh:
            raise HTTPException(403, stale_text())
        await super().handle(scope, receive, send)


class ProtectedSocket(WebSocketRoute):
    """A socket route whose endpoint is called only for visitors with a right."""

    def __init__(self, path: str, endpoint: Callable[..., Any], right: Right) -> None:
        super().__init__(path, endpoint)
        self.right = right

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Call the endpoint; for visitors without the right, close the socket with the reason."""
        if _may(scope, self.right):
            await super().handle(scope, receive, send)
        else:
            await turn_away(scope, receive, send, _refusal(scope, self.right))


def stale_text() -> str:
    """Return the message for visitors whose sign-in is too old."""
    minutes = round(FRESH_S / 60)
    return t("Sign in again: this needs a sign-in within the last {n} minutes.", n=minutes)


async def turn_away(scope: Scope, receive: Receive, send: Send, reason: str) -> None:
    """Accept a socket, then close it with the reason; pages cannot read a refused handshake."""
    await receive()
    # A viewer shows a status of its own protocol.
    subprotocol = chosen_subprotocol(scope.get("subprotocols", ()))
    text = encode_status("error", reason).decode() if subprotocol else ""
    await send({"type": "websocket.accept", "subprotocol": subprotocol})
    await send({"type": "websocket.send", "text": text or encode_error("refused", reason)})
    cut = close_reason(reason)
    await send({"type": "websocket.close", "code": CLOSE_NOT_LET_IN, "reason": cut})


def _may(scope: Scope, right: Right) -> bool:
    if right.is_site:
        return scope["state"].get("site") is not None
    if scope["state"].get("is_code"):
        return True  # the secret path of frame code; frames send no cookies
    visitor: RightHolder = scope["state"]["visitor"]
    robot = scope["path_params"].get("name", "") if right.scope == "robot" else ""
    return visitor.may(right, robot)


def _refusal(scope: Scope, right: Right) -> str:
    """Return why a visitor lacks a right; a limit of this site is the better reason."""
    visitor: RightHolder = scope["state"]["visitor"]
    return visitor.limit(scope["path_params"].get("name", "")) or right.refusal
