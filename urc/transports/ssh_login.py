"""How to get into an SSH server: who we are, what we show, which algorithms we take."""

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
    # What servers of 2005 to 2015 speak; weak, and only where the document says so.
    "kex_algs": "+diffie-hellman-group14-sha1,diffie-hellman-group1-sha1,"
    "diffie-hellman-group-exchange-sha1",
    "encryption_algs": "+aes256-cbc,aes192-cbc,aes128-cbc,3des-cbc",
    "mac_algs": "+hmac-sha1,hmac-md5,hmac-sha1-96",
    "signature_algs": "+ssh-rsa,ssh-dss",
}


class Login(NamedTuple):
    """Who we are to the server."""

    username: str
    password: str = ""
    key: str = ""
    """Path of a private key's file, or the key itself."""
    passphrase: str = ""
    agent: bool = False
    """Ask the agent of ``SSH_AUTH_SOCK`` for keys."""
    legacy: bool = False
    """Take algorithms that are no longer safe."""

    def __repr__(self) -> str:
        """Name the user alone: the rest must get into no log."""
        return f"Login({self.username!r})"


def algorithms(login: Login) -> dict[str, Any]:
    """Return asyncssh's options for what may be negotiated, beside host keys."""
    if not login.legacy:
        return {}
    # Whoever writes 'legacy: true' knows; the warning would come in the middle of other output.
    warnings.filterwarnings("ignore", message="Diffie-Hellman over finite fields")
    return dict(_LEGACY)


def host_key_algorithms(
    known: Sequence[asyncssh.SSHKey], *, has_authorities: bool, legacy: bool
) -> list[str]:
    """Return the kinds of host key we take, those that we know first: servers have several."""
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
    """Give asyncssh's options for the login; the agent is asked while the context lasts.

    Raises:
        ConnectFailed: the key cannot be used, or there is no agent.
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
            # None: nothing is looked for in ~/.ssh, which is not the document's business.
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
    """Read the key in a thread: a passphrase costs up to a second of arithmetic."""
    try:
        return await asyncio.to_thread(_read_key, login)
    except asyncssh.KeyEncryptionError as fault:
        wrong = "the passphrase does not fit" if login.passphrase else "it needs a passphrase"
        raise ConnectFailed(f"cannot use {_shown(login.key)}: {wrong}") from fault
    except asyncssh.KeyImportError as fault:
        if "passphrase" in str(fault).lower():
            raise ConnectFailed(f"cannot use {_shown(login.key)}: it needs a passphrase") from fault
        raise ConnectFailed(f"{_shown(login.key)} is no private key of SSH") from fault
    except (OSError, ValueError) as fault:
        why = str(getattr(fault, "strerror", None) or fault).lower()
        raise ConnectFailed(f"cannot read {_shown(login.key)} ({why})") from fault


def _read_key(login: Login) -> asyncssh.SSHKey:
    if "-----BEGIN" in login.key:
        # A setting is one line on some screens: what was the end of a line is a space there.
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
        raise ConnectFailed("the SSH agent holds no keys; 'ssh-add' adds one")
    return agent, keys
