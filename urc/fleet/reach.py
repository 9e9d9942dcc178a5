"""Why the addresses of a fleet cannot be reached, each as one line.

Layer 4. Zenoh tries again without a reason when an address is wrong or a certificate is refused.
This module opens the connection as Zenoh does, and names the reason.
"""

import socket
import ssl
from collections.abc import Iterator
from datetime import datetime
from typing import Final

from urc.fleet.membership import Membership
from urc.fleet.names import FleetError, address_of

__all__ = ["reach_faults"]

_CONNECT_S: Final = 3.0
_REFUSAL_S: Final = 1.0
"""Wait for the refusal of this site's certificate, in seconds. The other end checks the certificate
after the handshake, and then waits for this end."""


def reach_faults(membership: Membership, now: datetime) -> Iterator[str]:
    """Yield a line for each address that this site cannot use; the function blocks.

    Args:
        membership: the membership of this site.
        now: time with a time zone.
    """
    for endpoint in membership.connect:
        if fault := _fault(membership, endpoint, now):
            yield f"{address_of(endpoint)}: {fault}"


def _fault(membership: Membership, endpoint: str, now: datetime) -> str:
    host, _, port = address_of(endpoint).rpartition(":")
    try:
        line = socket.create_connection((host.strip("[]"), int(port)), _CONNECT_S)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        return f"cannot be reached ({reason}); check the address, the server and the firewall there"
    with line:
        try:
            return _refusal(membership, line, now)
        except ssl.SSLError as error:
            return f"is not a site of a fleet ({_reason(error)}); check the address"
        except FleetError as error:
            return str(error)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            return f"ended the connection ({reason}); try again"


def _refusal(membership: Membership, line: socket.socket, now: datetime) -> str:
    """Return why one end refuses the other's certificate; "" if both are accepted.

    Raises:
        FleetError: the certificate of the other end is not valid in this fleet at this time.
        OSError: the connection failed.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    # `Membership.peer` names the reason for which TLS would only refuse.
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    context.load_cert_chain(membership.certificate_file, membership.key_file)
    with context.wrap_socket(line) as secure:
        other = membership.peer(secure.getpeercert(binary_form=True) or b"", now, is_renewal=True)
        secure.settimeout(_REFUSAL_S)
        try:
            secure.recv(1)
        except TimeoutError:
            return ""
        except ssl.SSLError as error:
            return (
                f"the site {other.site} refuses the certificate of this site ({_reason(error)});"
                f" run 'urc doctor' at the site {other.site} and compare the clocks"
            )
    return ""


def _reason(error: ssl.SSLError) -> str:
    """Return the reason of TLS in words, such as ``certificate expired``."""
    words = (error.reason or str(error)).lower().replace("_", " ")
    return words.rpartition(" alert ")[2]
