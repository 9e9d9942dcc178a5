"""Functions that open an SSH connection: socket, host key check, login and error messages."""

from typing import Any, NamedTuple

import asyncssh

from urc.transports._faults import one_line
from urc.transports.base import ConnectFailed, TransportError
from urc.transports.known_hosts import HostKeys, HostKeyStatus, fingerprint
from urc.transports.ssh_connection import SshConnection
from urc.transports.ssh_login import Login, algorithms, credentials, host_key_algorithms
from urc.transports.ssh_wire import TunnelAdapter, why_lost
from urc.transports.topic_socket import Address

__all__ = ["OfferedHostKey", "SshTarget", "dial", "look_at_key"]

ALIVE_COUNT = 2
"""Maximum number of unanswered keepalives before the connection counts as lost."""


class OfferedHostKey(NamedTuple):
    """The host key that a server has offered."""

    key: asyncssh.SSHKey
    expected: str = ""
    """Fingerprints of the expected keys, or ``revoked``, or ``unknown`` for an unknown server; ""
    if the offered key is trusted."""

    @property
    def fingerprint(self) -> str:
        """The fingerprint, in the form ``SHA256:…``."""
        return fingerprint(self.key)

    @property
    def algorithm(self) -> str:
        """The algorithm's name, such as ``ssh-ed25519``."""
        return self.key.algorithm.decode("ascii")


class SshTarget(NamedTuple):
    """The address of an SSH server, with the login and the trusted host keys."""

    address: Address
    login: Login
    keys: HostKeys
    keepalive_s: float = 2.0
    """Time without data from the server before a keepalive is sent, in seconds."""
    name: str = ""
    """The transport's name, for the hint about the command ``urc trust``."""


class _SshClient(asyncssh.SSHClient):
    """An asyncssh client that checks the host key and records why the connection ended."""

    def __init__(self, target: SshTarget, known: HostKeyStatus, *, only_looks: bool) -> None:
        self._keys = target.keys
        self._known = known
        self._only_looks = only_looks
        self.through: TunnelAdapter | None = None
        self.offer: OfferedHostKey | None = None

    def validate_host_public_key(
        self, host: str, addr: str, port: int, key: asyncssh.SSHKey
    ) -> bool:
        self.offer = OfferedHostKey(key, self._keys.judge(key, self._known))
        return not self.offer.expected and not self._only_looks

    def connection_lost(self, exc: Exception | None) -> None:
        if self.through is not None:
            self.through.wire.end(why_lost(exc))


async def dial(
    target: SshTarget, outer: asyncssh.SSHClientConnection | None, timeout_s: float
) -> SshConnection:
    """Connect to the SSH server `target`, check its host key, and log in.

    Args:
        target: the server.
        outer: SSH connection that tunnels the new connection; None for this machine's own network.
        timeout_s: total time for all addresses of the server, in seconds; the caller enforces the
            limit.

    Raises:
        ConnectFailed: the connection or the login failed; the message may include a hint.
    """
    client = _SshClient(target, _known(target), only_looks=False)
    async with credentials(target.login) as secrets:
        return await _connect(target, client, outer, timeout_s, secrets)


async def look_at_key(
    target: SshTarget, outer: asyncssh.SSHClientConnection | None, timeout_s: float
) -> OfferedHostKey:
    """Return the server's host key without logging in; see `dial` for the parameters."""
    client = _SshClient(target, _known(target), only_looks=True)
    try:
        connection = await _connect(target, client, outer, timeout_s, {"client_keys": None})
        await connection.close()  # trusted because an authority has signed the key
    except ConnectFailed:
        if client.offer is None:
            raise
    if client.offer is None:
        raise ConnectFailed(
            f"{target.address.text} presents a certificate, which needs no confirmation"
        )
    return client.offer


async def _connect(
    target: SshTarget,
    client: _SshClient,
    outer: asyncssh.SSHClientConnection | None,
    timeout_s: float,
    secrets: dict[str, Any],
) -> SshConnection:
    try:
        client.through = through = TunnelAdapter(outer or await target.address.dial(timeout_s))
    except (OSError, UnicodeError) as fault:
        raise ConnectFailed(target.address.explain(fault)) from fault
    known = _known(target)
    try:
        ssh = await asyncssh.connect(
            target.address.host,
            target.address.port,
            client_factory=lambda: client,
            config=None,  # ignore ~/.ssh/config, so that a document works the same for all users
            tunnel=through,
            known_hosts=([], list(known.authorities), list(known.revoked)),
            server_host_key_algs=host_key_algorithms(
                known.trusted,
                has_authorities=bool(known.authorities),
                legacy=target.login.legacy,
            ),
            keepalive_interval=target.keepalive_s,
            keepalive_count_max=ALIVE_COUNT,
            gss_host=None,
            host_based_auth=False,
            **algorithms(target.login),
            **secrets,
        )
    except (asyncssh.Error, OSError, ValueError) as fault:
        raise ConnectFailed(_explain(target, client, fault)) from fault
    finally:
        through.give_up_unused()
    return SshConnection(ssh, through.wire, target.address)


def _known(target: SshTarget) -> HostKeyStatus:
    try:
        return target.keys.known(target.address.host, target.address.port)
    except TransportError as fault:
        raise ConnectFailed(str(fault)) from fault


def _explain(target: SshTarget, client: _SshClient, fault: Exception) -> str:
    """Return a one-line message with the reason for a failed connection."""
    place, login = target.address.text, target.login
    if client.offer is not None and client.offer.expected:
        return _explain_key(target, client.offer)
    match fault:
        case asyncssh.PermissionDenied():
            shown = [
                what
                for what, is_shown in (
                    ("password", login.password), ("key", login.key), ("agent", login.agent)
                )
                if is_shown
            ]  # fmt: skip
            text = " and ".join(shown) or "no password and no key"
            return f"{place} rejects the login of {login.username!r} (tried: {text})"
        case asyncssh.HostKeyNotVerifiable():
            return f"the host key of {place} is not trusted ({_first(fault.reason)})"
        case asyncssh.KeyExchangeFailed():
            hint = "" if login.legacy else "; 'legacy: true' permits old algorithms"
            return f"{place} offers no algorithm that URC accepts{hint} ({_first(fault.reason)})"
        case asyncssh.ConnectionLost():
            return f"{place} closed the connection before the login was complete"
        case asyncssh.ProtocolError() | asyncssh.ProtocolNotSupported():
            return f"{place} does not speak SSH as expected ({_first(fault.reason).lower()})"
        case asyncssh.DisconnectError():
            return f"{place} refused the connection ({_first(fault.reason).lower()})"
        case asyncssh.ChannelOpenError():
            return (
                f"nothing listens on {place} at the far end of the tunnel"
                f" ({_first(fault.reason).lower()})"
            )
        case _:
            return f"cannot connect to {place} ({_first(str(fault)).lower()})"


def _explain_key(target: SshTarget, offer: OfferedHostKey) -> str:
    place, shown = target.address.text, f"{offer.fingerprint} ({offer.algorithm})"
    command = f"'urc trust PROFILE {target.name}'"
    if offer.expected == "unknown":
        return (
            f"the host key of {place} is unknown: found {shown}; "
            f"if the key belongs to the robot, {command} trusts the key"
        )
    if offer.expected == "revoked":
        return f"the host key of {place} is revoked: found {shown}"
    if target.keys.is_pinned:
        remedy = "put the new key into host_key"
    else:
        remedy = f"{command} trusts the new key"
    return (
        f"the host key of {place} has changed: expected {offer.expected}, found {shown}; "
        f"the connection may be intercepted. If the robot was reinstalled, {remedy}"
    )


def _first(text: str) -> str:
    return one_line(text.splitlines()[0]) if text else "no reason was given"
