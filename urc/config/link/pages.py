"""Other people's pages that a widget's options name: which they are, and whether they can be shown.

The host of such a page is written into the policy of the document that shows it, so a URL has to be
one that all browsers read alike: what is not plainly so is refused here.
"""

import ipaddress
import re
from typing import Final

from urc.config.link.files import named_texts
from urc.config.part import Findings, Part
from urc.model.widget import Widget

__all__ = ["LONGEST_URL", "link_pages"]

LONGEST_URL: Final = 2000
"""In characters."""

_URL: Final = re.compile(
    r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]*):(?://(?P<authority>[^/?#\\]*))?(?P<rest>.*)", re.DOTALL
)
_HOST: Final = re.compile(r"(?P<host>[A-Za-z0-9._-]{1,253})(?::(?P<port>[0-9]{1,5}))?", re.ASCII)
_REST: Final = re.compile(r"[!#-;=?-\[\]_a-z~]*", re.ASCII)
_NUMBER: Final = re.compile(r"[0-9]+|0[xX][0-9A-Fa-f]*", re.ASCII)
_LAST_PORT: Final = 65535


def link_pages(options: Part, widget: Widget, findings: Findings) -> dict[str, tuple[str, ...]]:
    """Return each option that may name pages, of those given → the URLs that it names.

    Args:
        options: of one slot, of a shape that is known to be right.
        widget: whose manifest says which of them are pages.
        findings: takes what is wrong. An empty text names no page, and is right.
    """
    found: dict[str, tuple[str, ...]] = {}
    for name, part in named_texts(options, widget.options, "page"):
        url = str(part.data)
        fault = _fault(url) if url else ""
        if fault:
            hint = "write it as http://robot.local:8080/status"
            findings.error(part, "page-not-shown", f"{url[:80]!r} {fault}", hint=hint)
        found[name] = (*found.get(name, ()), *((url,) if url and not fault else ()))
    return found


def _fault(url: str) -> str:
    parts = _URL.fullmatch(url)
    if parts is None or parts["scheme"].lower() not in ("http", "https"):
        return "is no http or https URL"
    if len(url) > LONGEST_URL:
        return f"is longer than {LONGEST_URL} characters"
    authority = parts["authority"] or ""
    if "@" in authority:
        return "holds a name or password, which everybody who sees the page could read"
    if authority.startswith("["):
        return "names an IPv6 address, which the policy of a page cannot; give the host a name"
    host = _HOST.fullmatch(authority)
    if host is None or not _is_host(host["host"]):
        return "names no host that all browsers read alike"
    if host["port"] is not None and not 0 < int(host["port"]) <= _LAST_PORT:
        return f"names a port that is not 1 to {_LAST_PORT}"
    if not _REST.fullmatch(parts["rest"]):
        return "holds a character that a URL writes as %XX"
    return ""


def _is_host(host: str) -> bool:
    labels = host.removesuffix(".").split(".")
    if not all(labels):
        return False
    # Browsers take `127.1` and `0x7f000001` for addresses, too: only the usual way is let through.
    if _NUMBER.fullmatch(labels[-1]):
        try:
            ipaddress.IPv4Address(host)
        except ValueError:
            return False
    return True
