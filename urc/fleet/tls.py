"""Contexts for mutual TLS 1.3 between the sites of a fleet.

Layer 4.
"""

import ssl
from pathlib import Path
from typing import Any

from urc.fleet.certificates import FleetRoot
from urc.fleet.names import FleetError

__all__ = ["site_client_context", "site_server_context"]


class _ClientContext(ssl.SSLContext):
    """A context that expects one site; it ignores the host name from its caller."""

    site: str

    # A caller cannot connect to another site by mistake: the address of a site, which asyncio
    # would otherwise use, is not its name.
    def wrap_bio(self, *args: Any, **options: Any) -> ssl.SSLObject:
        return super().wrap_bio(*args, **(options | {"server_hostname": self.site}))

    def wrap_socket(self, *args: Any, **options: Any) -> ssl.SSLSocket:
        return super().wrap_socket(*args, **(options | {"server_hostname": self.site}))


def site_server_context(root: FleetRoot, certificate: Path, key: Path) -> ssl.SSLContext:
    """Return a context that accepts clients with a certificate of this fleet.

    Args:
        root: the only trusted root.
        certificate: file with the site's certificate, in PEM.
        key: file with its key, in PEM.

    Raises:
        FleetError: the files are unreadable or do not match.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    # A resumed session would skip the certificates, which may have been revoked in the meantime.
    context.num_tickets = 0
    return _prepared(context, root, certificate, key)


def site_client_context(root: FleetRoot, certificate: Path, key: Path, site: str) -> ssl.SSLContext:
    """Return a context that accepts only the server with the certificate of `site`.

    The arguments and errors are those of `site_server_context`.
    """
    context = _ClientContext(ssl.PROTOCOL_TLS_CLIENT)
    context.site = site
    context.check_hostname = True
    context.hostname_checks_common_name = False
    return _prepared(context, root, certificate, key)


def _prepared(
    context: ssl.SSLContext, root: FleetRoot, certificate: Path, key: Path
) -> ssl.SSLContext:
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.verify_mode = ssl.CERT_REQUIRED
    context.verify_flags |= ssl.VERIFY_X509_STRICT
    context.load_verify_locations(cadata=root.pem.decode())
    try:
        context.load_cert_chain(certificate, key)
    except OSError as error:  # `ssl.SSLError` too
        raise FleetError(
            f"{certificate} and {key.name} cannot be used: {error.strerror or error}"
        ) from error
    return context
