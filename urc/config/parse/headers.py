"""Headers of web requests: those that a document may not set."""

from urc._headers import is_reserved
from urc.config.part import Findings, Part

__all__ = ["check_headers"]


def check_headers(part: Part, findings: Findings) -> None:
    """Report each header under ``headers`` of `part` that says who asks, or frames the request."""
    headers = part.entries().get("headers")  # most kinds of transports have none
    for name, inner in headers.entries().items() if headers else ():
        if is_reserved(name):
            findings.error(
                inner,
                "reserved-header",
                f"a document may not set the header {name!r}",
                key=True,
                hint="URC sets it where it is needed; a login goes under 'auth'",
            )
