"""Rights of a visitor. The start key adds rights, and a page may choose only to watch.

Layer 5. Pure.
"""

from ipaddress import ip_address

from starlette.requests import HTTPConnection

from urc.web.page_socket import SocketPeer
from urc.web.serve.access import UNKNOWN_VISITOR, Visitor

__all__ = ["guest_of", "is_here", "may_manage", "visitor_of"]


def visitor_of(connection: HTTPConnection) -> Visitor:
    """Return the visitor that the page policy has identified for a request."""
    found: Visitor = getattr(connection.state, "visitor", UNKNOWN_VISITOR)
    return found


def guest_of(connection: HTTPConnection) -> SocketPeer:
    """Return the visitor's identity as other pages of the robot see it."""
    host = connection.client.host if connection.client else ""
    has_key = is_here(connection)
    place = "" if has_key and _is_loopback(host) else host
    visitor = visitor_of(connection)
    is_known = visitor.standing != "stranger"
    who = f"{visitor.standing} {visitor.name}" if is_known else f"at {host}"
    if "watch" in connection.query_params:
        return SocketPeer(place, "watch", who, is_known)
    return SocketPeer(place, "administer" if has_key else "drive", who, is_known)


def is_here(connection: HTTPConnection) -> bool:
    """Return whether the visitor has the start key, regardless of the visitor's address."""
    return visitor_of(connection).standing == "here"


def may_manage(connection: HTTPConnection) -> bool:
    """Return whether the visitor may install packages and change settings."""
    return visitor_of(connection).standing in ("here", "manager")


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return False
