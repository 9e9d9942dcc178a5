"""The HTTPS options of `urc serve`, `urc demo` and `urc replay`."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

from urc.cli.arguments import is_loopback
from urc.cli.error_report import Misuse
from urc.cli.output import complain

if TYPE_CHECKING:
    from starlette.types import ASGIApp

    from urc.web.serve.certificates import Certificates

__all__ = ["PLAIN", "TlsOptions", "add_tls", "certificates_of", "tls_of"]


class TlsOptions(NamedTuple):
    """The kind of certificate, and the public names of a web server in front of URC."""

    kind: Literal["plain", "local", "given"] = "plain"
    """Plain HTTP, a certificate from the local authority, or a certificate from files."""
    chain: Path = Path()
    key: Path = Path()
    public_names: Sequence[str] = ()
    """Host names, with optional ports, for which another web server provides HTTPS."""

    def around(self, app: "ASGIApp") -> "ASGIApp":
        """Return an application that treats requests to the public names as HTTPS."""
        from urc.web.serve.tls_port import BehindProxy

        return BehindProxy(app, self.public_names) if self.public_names else app

    def hosts(self) -> list[str]:
        """Return the public names without ports, for checking the Host header."""
        from urc.web.serve.policy import parse_host

        return [one.host for one in map(parse_host, self.public_names) if one is not None]


PLAIN = TlsOptions()


def add_tls(parser: argparse.ArgumentParser) -> None:
    """Declare the HTTPS options."""
    parser.add_argument(
        "--tls",
        choices=("auto",),
        help="HTTPS with a certificate from this machine's certificate authority"
        " (default for a --host that other machines can reach)",
    )
    parser.add_argument(
        "--tls-cert",
        metavar="FILE",
        type=Path,
        help="HTTPS with the certificate in this PEM file; intermediate certificates may follow it",
    )
    parser.add_argument(
        "--tls-key",
        metavar="FILE",
        type=Path,
        help="private key for --tls-cert, in PEM without a passphrase",
    )
    parser.add_argument(
        "--behind-proxy",
        metavar="NAME",
        action="append",
        default=[],
        help="public name of a web server on this machine that provides HTTPS for URC",
    )
    parser.add_argument(
        "--insecure-plain-http",
        action="store_true",
        help="plain HTTP even if other machines can reach --host: everyone on the network can"
        " read keys and change commands",
    )


def tls_of(arguments: argparse.Namespace) -> TlsOptions:
    """Return the HTTPS options from the command line.

    Raises:
        Misuse: the options contradict each other, or a name is invalid.
    """
    from urc.web.serve.policy import parse_host

    names = tuple(arguments.behind_proxy)
    for name in names:
        if parse_host(name) is None:
            raise Misuse(f"--behind-proxy: expected a name like robots.example, found {name!r}")
    if bool(arguments.tls_cert) is not bool(arguments.tls_key):
        raise Misuse("--tls-cert and --tls-key require each other: specify both")
    if arguments.tls and arguments.tls_cert:
        raise Misuse("--tls auto makes a certificate: remove --tls-cert and --tls-key, or --tls")
    if arguments.insecure_plain_http:
        if arguments.tls or arguments.tls_cert:
            raise Misuse("--insecure-plain-http turns HTTPS off: remove it, or the --tls options")
        return TlsOptions(public_names=names)
    if arguments.tls_cert:
        return TlsOptions("given", arguments.tls_cert, arguments.tls_key, names)
    is_local = arguments.tls == "auto" or not is_loopback(arguments.host)
    return TlsOptions("local" if is_local else "plain", public_names=names)


async def certificates_of(
    options: TlsOptions, host: str, allowed_hosts: Sequence[str], data: Path
) -> "Certificates | None":
    """Return the certificates of a server; None for plain HTTP.

    Raises:
        UrcError: a certificate cannot be created or read.
    """
    if options.kind == "plain":
        if not is_loopback(host):
            complain(
                f"urc: {host} uses plain HTTP: everyone on the network can read keys and change"
                " commands"
            )
        return None
    from urc.access.authority import AUTHORITY_FOLDER
    from urc.web.serve.certificates import (
        Certificates,
        CertificateSource,
        GivenCertificate,
        LocalCertificate,
    )

    source: CertificateSource = LocalCertificate(data / AUTHORITY_FOLDER, host, allowed_hosts)
    if options.kind == "given":
        source = GivenCertificate(options.chain, options.key)
    certificates = await Certificates.of(source)
    for note in certificates.current.notes:
        complain(f"urc: {note}")
    return certificates
