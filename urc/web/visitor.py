"""Who asks: whoever sits at this machine may do more; a page may choose to watch only.

Floor 5. Pure. Until people sign in, this is all that is known of them.
"""

from ipaddress import ip_address

from starlette.requests import HTTPConnection

from urc.web.socket import Guest

__all__ = ["guest_of", "is_here"]


def guest_of(connection: HTTPConnection) -> Guest:
    """Return who asks."""
    host = connection.client.host if connection.client else ""
    try:
        is_local = ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        is_local = False
    if "watch" in connection.query_params:
        return Guest("" if is_local else host, "viewer")
    return Guest("", "engineer") if is_local else Guest(host, "driver")


def is_here(connection: HTTPConnection) -> bool:
    """Return whether somebody at this machine asks."""
    return not guest_of(connection).place
