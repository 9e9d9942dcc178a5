"""The login to an SSH server: user, credentials and accepted algorithms."""

import asyncio
import os
import warnings
from collections.abc import Sequence
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import asyncssh

from urc.transports.base import ConnectFailed

__all__ = ["Login", "algorithms", "credentials", "host_key_algorithms"]

_HOST_KEYS = (
    "ssh-ed25519", "ecdsa-sha2-nistp256", "ecdsa-sha2-nistp384", "ecdsa-sha2-nistp521",
    "rsa-sha2-512", "rsa-sha2-256",
)  # fmt: skip
_LEGACY_HOST_KEYS = ("ssh-rsa", "ssh-dss")
_CERTIFICATES = tuple(
    f"{name}-cert-v01@openssh.com"
    for name in ("ssh-ed25519", "ecdsa-sha2-nistp256", "rsa-sha2-512", "rsa-sha2-256")
)
_LEGACY = {
    # Weak algorithms of servers from 2005 to 2015, used only if the document requests them.
    "kex_algs": "+diffie-hellman-group14-sha1,diffie-hellman-group1-sha1,"
    "diffie-hellman-group-exchange-sha1",
    "encryption_algs": "+aes256-cbc,aes192-cbc,aes128-cbc,3des-cbc",
    "mac_algs": "+hmac-sha1,hmac-md5,hmac-sha1-96",
    "signature_algs": "+ssh-rsa,ssh-dss",
}


class Login(NamedTuple):
    """The user and the credentials for an SSH server."""

    username: str
    password: str = ""
    key: str = ""
    """Path of a private key file, or the key's text."""
    passphrase: str = ""
    agent: bool = False
    """Whether to use keys from the SSH agent at ``SSH_AUTH_SOCK``."""
    legacy: bool = False
    """Whether to accept legacy algorithms that are no longer secure."""

    def __repr__(self) -> str:
        """Return text that contains only the user name, so that no secret enters a log."""
        return f"Login({self.username!r})"


def algorithms(login: Login) -> dict[str, Any]:
    """Return asyncssh options for the accepted algorithms, except for host key algorithms."""
    if not login.legacy:
        return {}
    # 'legacy: true' is a deliberate choice; the warning would clutter other output.
    warnings.filterwarnings("ignore", message="Diffie-Hellman over finite fields")
    return dict(_LEGACY)


def host_key_algorithms(
    known: Sequence[asyncssh.SSHKey], *, has_authorities: bool, legacy: bool
) -> list[str]:
    """Return the accepted host key types: certificates, types of known keys, then all others."""
    familiar = [
        name.decode("ascii")
        for key in known
        for name in key.sig_algorithms
        if legacy or name.decode("ascii") not in _LEGACY_HOST_KEYS
    ]
    certificates = _CERTIFICATES if has_authorities else ()
    late = _LEGACY_HOST_KEYS if legacy else ()
    return list(dict.fromkeys((*certificates, *familiar, *_HOST_KEYS, *late)))


@asynccontextmanager
async def credentials(login: Login):  # type: ignore[no-untyped-def]
    """Yield asyncssh options for the login; the SSH agent is available while the context is open.

    Raises:
        ConnectFailed: the key is unusable, or the SSH agent is missing.
    """
    keys: list[Any] = []
    agent: asyncssh.SSHAgentClient | None = None
    if login.key:
        keys.append(await _private_key(login))
    try:
        if login.agent:
            agent, offered = await _agent_keys()
            keys += offered
        yield {
            "username": login.username,
            "password": login.password or None,
            # None: ignore the keys in ~/.ssh, which do not belong to the document.
            "client_keys": keys or None,
            "agent_path": None,
            "kbdint_auth": bool(login.password),
            "password_auth": bool(login.password),
            "public_key_auth": bool(keys),
        }
    finally:
        if agent is not None:
            agent.close()
            await agent.wait_closed()


async def _private_key(login: Login) -> asyncssh.SSHKey:
    """Read the key in a thread, because decryption with a passphrase takes up to a second."""
    try:
        return await asyncio.to_thread(_read_key, login)
    except asyncssh.KeyEncryptionError as fault:
        wrong = "the passphrase is wrong" if login.passphrase else "it needs a passphrase"
        raise ConnectFailed(f"cannot use {_shown(login.key)}: {wrong}") from fault
    except asyncssh.KeyImportError as fault:
        if "passphrase" in str(fault).lower():
            raise ConnectFailed(f"cannot use {_shown(login.key)}: it needs a passphrase") from fault
        raise ConnectFailed(f"{_shown(login.key)} is not an SSH private key") from fault
    except (OSError, ValueError) as fault:
        why = str(getattr(fault, "strerror", None) or fault).lower()
        raise ConnectFailed(f"cannot read {_shown(login.key)} ({why})") from fault


def _read_key(login: Login) -> asyncssh.SSHKey:
    if "-----BEGIN" in login.key:
        # Some pages show a setting as one line, which converts its line ends to spaces.
        return asyncssh.import_private_key(login.key.strip() + "\n", login.passphrase or None)
    return asyncssh.read_private_key(os.path.expanduser(login.key), login.passphrase or None)


def _shown(key: str) -> str:
    return "the key in the settings" if "-----BEGIN" in key else f"the key {key}"


async def _agent_keys() -> tuple[asyncssh.SSHAgentClient, list[Any]]:
    path = os.environ.get("SSH_AUTH_SOCK", "")
    if not path:
        raise ConnectFailed("there is no SSH agent: SSH_AUTH_SOCK is not set")
    agent = asyncssh.SSHAgentClient(path)
    try:
        keys = list(await agent.get_keys())
    except (OSError, ValueError) as fault:
        agent.close()
        why = str(getattr(fault, "strerror", None) or fault).lower()
        raise ConnectFailed(f"the SSH agent at {path} does not answer ({why})") from fault
    except BaseException:
        agent.close()
        raise
    if not keys:
        agent.close()
        raise ConnectFailed("the SSH agent holds no keys; 'ssh-add' adds a key")
    return agent, keys
