"""Visitors: the identity of each request and its current rights.

Layer 5. Pure.
"""

from ipaddress import ip_address
from typing import Protocol

from starlette.requests import HTTPConnection

from urc.access.directory import NOBODY, Identity
from urc.model.role import Role, includes
from urc.web.feed.client_socket import SocketPeer
from urc.web.serve.rights import FRESH_S, Right

__all__ = ["Visitor", "VisitorRights", "is_loopback", "peer_of", "visitor_of"]


class VisitorRights(Protocol):
    """The methods of `urc.web.serve.access.Access` that visitors use."""

    def role(self, who: Identity, robot: str = "") -> Role | None:
        """Return the current role of `who` for a robot; "" stands for the whole server."""

    def best_role(self, who: Identity) -> Role | None:
        """Return the highest current role of `who` for any robot."""

    def may_give(self, who: Identity, command: str) -> bool:
        """Return whether a token permits a command; "" stands for all commands."""

    def limit(self, who: Identity, robot: str) -> str:
        """Return why the role of `who` for a robot is limited, as one line; "" if it is not."""

    def signed_in_s(self, who: Identity) -> float:
        """Return the time since `who` signed in, in seconds."""

    def is_local(self, who: Identity) -> bool:
        """Return whether `who` is the local user with a valid sign-in."""


class Visitor:
    """The sender of a request, with its current rights."""

    __slots__ = ("_rights", "identity", "is_program")

    def __init__(
        self, rights: VisitorRights, identity: Identity = NOBODY, *, is_program: bool = False
    ) -> None:
        """Store the identity.

        Args:
            rights: source of the current rights.
            identity: the proven identity; `NOBODY` for an unknown visitor.
            is_program: whether the request contains a token, even an invalid token. Pages from
                other sites cannot send such requests.
        """
        self._rights = rights
        self.identity = identity
        self.is_program = is_program

    @property
    def is_known(self) -> bool:
        """Whether the visitor has signed in, or has a token."""
        return self.identity != NOBODY

    @property
    def is_local(self) -> bool:
        """Whether the visitor is currently the local user."""
        return self._rights.is_local(self.identity)

    @property
    def is_fresh(self) -> bool:
        """Whether the visitor has signed in within the last `FRESH_S` seconds.

        The local user and programs cannot sign in again, so their sign-ins always count as recent.
        """
        if self.is_local or self.identity.way == "token":
            return True
        return self._rights.signed_in_s(self.identity) <= FRESH_S

    @property
    def client(self) -> str:
        """Identifier for counting the visitor's requests; "" for an unknown visitor.

        The local user's browsers are counted separately, because several people may use the start
        key.
        """
        who = self.identity
        return who.sign_in if self.is_local else who.principal

    def role(self, robot: str = "") -> Role | None:
        """Return the current role for a robot; "" stands for the whole server."""
        return self._rights.role(self.identity, robot)

    def best_role(self) -> Role | None:
        """Return the highest current role for any robot."""
        return self._rights.best_role(self.identity)

    def may_give(self, command: str) -> bool:
        """Return whether the visitor's token permits a command."""
        return self._rights.may_give(self.identity, command)

    def limit(self, robot: str) -> str:
        """Return why this site limits a visitor's role for a robot; "" if it does not."""
        return self._rights.limit(self.identity, robot)

    def may(self, right: Right, robot: str = "") -> bool:
        """Return whether the visitor currently has a right; `robot` names the robot, if any.

        A token that is limited to certain commands never permits maintenance or administration,
        regardless of its role.
        """
        if right.role is None:
            return True
        if includes(right.role, "maintain") and not self.may_give(""):
            return False
        if right.is_local:
            return self.is_local
        if right.scope == "anywhere":
            return includes(self.best_role(), right.role)
        return includes(self.role(robot if right.scope == "robot" else ""), right.role)


class _RobotRights:
    """A visitor's current rights for one robot; see `urc.web.feed.client_socket.PeerRights`."""

    def __init__(self, visitor: Visitor, robot: str, *, only_watches: bool) -> None:
        self._visitor = visitor
        self._robot = robot
        self._only_watches = only_watches

    def role(self) -> Role | None:
        """Return the current role."""
        role = self._visitor.role(self._robot)
        return "watch" if self._only_watches and role is not None else role

    def may_give(self, command: str) -> bool:
        """Return whether the visitor's token permits a command."""
        return self._visitor.may_give(command)

    def limit(self) -> str:
        """Return why this site limits the role, as one line; "" if it does not."""
        return self._visitor.limit(self._robot)


def visitor_of(connection: HTTPConnection) -> Visitor:
    """Return the visitor of a request, as identified by the page policy."""
    found: Visitor = connection.state.visitor
    return found


def peer_of(connection: HTTPConnection, robot: str, *, only_watches: bool = False) -> SocketPeer:
    """Return the visitor of a robot's socket, with its current rights for the robot.

    Args:
        connection: the handshake.
        robot: name of the robot.
        only_watches: whether the page may only watch; pages with ``?watch`` may never do more.
    """
    visitor = visitor_of(connection)
    host = connection.client.host if connection.client else ""
    only_watches = only_watches or "watch" in connection.query_params
    return SocketPeer(
        place="" if visitor.is_local and is_loopback(host) else host,
        who=visitor.client or f"at {host}",
        is_known=visitor.is_known,
        identity=visitor.identity,
        is_local=visitor.is_local,
        rights=_RobotRights(visitor, robot, only_watches=only_watches),
    )


def is_loopback(host: str) -> bool:
    """Return whether an address is a loopback address of this machine."""
    try:
        return ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return False
