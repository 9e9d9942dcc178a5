"""The causes of failed connections, each with advice for the operator.

Layer 4. Pure. Transports pass on error messages of the operating system or of a library. The table
recognises the usual error messages for every page. Pages translate a cause by its name
(`core/connection_causes.js`).
"""

import re
from typing import Final, Literal, NamedTuple

__all__ = ["CAUSES", "Cause", "advice_on", "cause_of"]

Cause = Literal[
    "",
    "refused",
    "unreachable",
    "timeout",
    "name",
    "host-key",
    "permission",
    "sign-in",
    "tls",
    "device",
    "closed",
    "login",
    "silent",
]
"""Name of a cause; "" for an unknown cause."""


class _CauseRow(NamedTuple):
    cause: Cause
    words: tuple[str, ...]
    """Lower-case words; the row applies if the error message contains one of them."""
    advice: str
    address: str = ""
    """Beginning of the addresses to which the row applies; "" means all addresses."""


CAUSES: Final = (
    _CauseRow(
        "refused",
        ("connection refused",),
        "the machine responds, but nothing listens on that port: check the port, and whether"
        " the robot's program is running",
    ),
    _CauseRow(
        "host-key",
        ("host key", "fingerprint"),
        "compare the robot's host key, then trust the key with 'urc trust'",
    ),
    _CauseRow(
        "permission",
        ("permission denied", "access is denied"),
        "URC's user is not allowed to open the device: add the user to the device's group",
        "serial",
    ),
    _CauseRow(
        "sign-in",
        (
            *("authenticat", "authoriz", "password", "permission denied", "login", "publickey"),
            *("401", "403"),
        ),
        "the robot rejects the login: check user, password and key file",
    ),
    _CauseRow(
        "tls",
        ("certificate", "no tls", "ssl"),
        "check the certificate, and whether the port speaks TLS",
    ),
    _CauseRow(
        "name",
        ("name or service", "no address", "not known", "resolve", "look up", "no such host"),
        "the host name cannot be resolved: check the spelling, or use a numeric address",
    ),
    _CauseRow(
        "unreachable",
        ("unreachable", "no route"),
        "the network is unreachable: is this machine on the robot's network?",
    ),
    _CauseRow(
        "login",
        ("on_connect steps are not complete",),
        "the robot does not answer the login: check user and password, and the kind of robot",
    ),
    _CauseRow(
        "silent",
        ("nothing received", "no data", "reply timeout", "no reply"),
        "connected, but the robot sends nothing: check the port and the kind of robot",
    ),
    _CauseRow(
        "timeout",
        ("timed out", "no answer", "within", "time-out", "timeout"),
        "no reply from that address: check the address, the network, and whether the robot is on",
    ),
    _CauseRow(
        "device",
        ("no such file", "could not open port", "no such device"),
        "the file or device does not exist: check the path, and whether the device is plugged in",
    ),
    _CauseRow(
        "closed",
        ("closed", "broke", "reset by peer", "broken pipe", "the connection ("),
        "the robot ended the connection: many robots serve only one program at a time",
    ),
)
"""All known causes; the first match applies."""


_NAMES: Final = re.compile(r"'[^']*'|[^\s:]+:\d+")
"""Pattern of quoted names, and of addresses with a port; words in them must not be taken for
causes."""


def cause_of(text: str, address: str = "") -> Cause:
    """Return the cause of a failed connection.

    Args:
        text: error message from the transport.
        address: target of the connection as text, such as ``tcp 10.0.0.5:6789``.
    """
    found = _known(text, address)
    return found.cause if found is not None else ""


def advice_on(text: str, address: str = "") -> str:
    """Return one line of advice about a failed connection; for the arguments, see `cause_of`."""
    found = _known(text, address)
    return found.advice if found is not None else "check the settings of this transport"


def _known(text: str, address: str) -> _CauseRow | None:
    lower = _NAMES.sub(" ", text.lower())
    for known in CAUSES:
        if any(word in lower for word in known.words) and address.startswith(known.address):
            return known
    return None
