"""Checks for HTTP headers that a document must not set."""

from urc._headers import is_reserved
from urc.config.node import Node, Problems

__all__ = ["check_headers"]


def check_headers(part: Node, problems: Problems) -> None:
    """Report each header of `part` that identifies the client or controls the request."""
    headers = part.entries().get("headers")  # most transport types have no headers
    for name, inner in headers.entries().items() if headers else ():
        if is_reserved(name):
            problems.error(
                inner,
                "reserved-header",
                f"a document may not set the header {name!r}",
                key=True,
                hint="URC sets this header if necessary; put credentials under 'auth'",
            )
