"""`urc trust`: show the host key of an SSH server, and store it after confirmation."""

import argparse
import sys
from typing import TYPE_CHECKING

from urc.cli.arguments import add_profile, load, what_it_has
from urc.cli.error_report import Misuse
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.model.profile import Profile
    from urc.model.values import Value
    from urc.transports.ssh import SshTransport
    from urc.transports.ssh_dial import OfferedHostKey

EXAMPLE = "urc trust my-robot.yaml --set host=192.168.1.20"

_NOT_ASKED_FOR = "-"
"""Placeholder for a password; reading a host key requires no login."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profile, transport and fingerprint."""
    add_profile(parser)
    parser.add_argument(
        "transport",
        metavar="TRANSPORT",
        nargs="?",
        help="name of the ssh transport, required if the profile has several",
    )
    parser.add_argument("--yes", metavar="SHA256:…", help="trust this fingerprint without asking")


def run(arguments: argparse.Namespace) -> int:
    """Show the host key, and store the key after confirmation; return 1 if nothing is stored."""
    from urc.cli.event_loop import run_loop

    profile = load(arguments.profile)
    name = _transport(profile, arguments.transport)
    line = _line(profile, name, _settings(profile, name, arguments))
    if line.target.keys.is_pinned:
        raise Misuse(f"transports.{name}: the document already specifies the key under host_key")
    offers: list[OfferedHostKey] = []

    async def look() -> int:
        offers.append(await line.look_at_key(profile.driver.transports[name].timeouts.connect_s))
        return 0

    code = run_loop(look())
    return _decide(line, offers[0], arguments.yes) if offers else code


def _transport(profile: "Profile", named: str | None) -> str:
    """Return the ssh transport with this name; without a name, return the only ssh transport."""
    choices = [name for name, spec in profile.driver.transports.items() if spec.type == "ssh"]
    if not choices:
        raise Misuse(f"{profile.name} has no ssh transport: nothing to trust")
    if named is None and len(choices) == 1:
        return choices[0]
    if named is None:
        raise Misuse(
            f"{profile.name} has several ssh transports; specify one of: {', '.join(choices)}"
        )
    if named not in choices:
        raise Misuse(
            f"{profile.name} has no ssh transport {named!r}; {what_it_has(named, choices)}"
        )
    return named


def _settings(profile: "Profile", name: str, arguments: argparse.Namespace) -> dict[str, "Value"]:
    """Return the settings. Secrets are optional unless a tunnel needs a login."""
    from urc.cli.settings import settings_given

    ((values, missing),) = settings_given([profile], arguments)
    if not profile.driver.transports[name].tunnel:
        values |= {one: _NOT_ASKED_FOR for one in missing if profile.settings[one].is_secret}
    missing = tuple(one for one in missing if one not in values)
    if missing:
        words = " ".join(f"--set {one}=…" for one in missing)
        raise Misuse(f"{profile.name} needs {', '.join(missing)}: add {words}")
    return values


def _line(profile: "Profile", name: str, settings: dict[str, "Value"]) -> "SshTransport":
    from urc.runtime.registries import built_in_catalog
    from urc.runtime.transport_chain import make_transports
    from urc.transports.ssh import SshTransport

    line = make_transports(profile.driver, settings, built_in_catalog().transports)[name]
    if not isinstance(line, SshTransport):
        raise UrcError(f"transports.{name}: URC cannot store keys for this ssh transport")
    return line


def _decide(line: "SshTransport", offer: "OfferedHostKey", yes: str | None) -> int:
    from urc.transports.known_hosts import remember

    address = line.target.address
    print(f"{address.text} has the host key {offer.fingerprint} ({offer.algorithm})")
    if not offer.expected:
        print("this key is already trusted")
        return 0
    if offer.expected == "revoked":
        raise UrcError("this key is revoked in the known-hosts file and cannot be trusted")
    if offer.expected != "unknown":
        print(
            f"the key has changed from {offer.expected}:"
            " either the robot was reinstalled, or an attacker is intercepting the connection"
        )
    if yes is None and not _is_confirmed():
        print("nothing was stored")
        return 1
    if yes is not None and yes.rstrip("=") != offer.fingerprint:
        raise UrcError(f"the key does not match {yes}; nothing was stored")
    file = remember(address.host, address.port, offer.key)
    print(f"stored the key in {file}")
    return 0


def _is_confirmed() -> bool:
    if not sys.stdin.isatty():
        raise Misuse("cannot ask without a terminal; use --yes SHA256:… to trust a key")
    try:
        return input("Is this the key of the robot? Type yes: ").strip().lower() == "yes"
    except EOFError:
        return False
