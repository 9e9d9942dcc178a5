"""The options of an SSH transport, from a document's plain values to what they mean."""

import re
from collections.abc import Mapping
from typing import Final, Literal, NamedTuple, cast

from urc.transports import _options
from urc.transports.base import Setup, TransportError
from urc.transports.known_hosts import DEFAULT_PORT, HostKeys
from urc.transports.ssh_dial import Target
from urc.transports.ssh_login import Login
from urc.transports.topic_socket import Address

__all__ = ["Mode", "Program", "read_program", "read_target"]

Mode = Literal["shell", "exec", "forward"]

_DURATION: Final = re.compile(r"([0-9]+(?:\.[0-9]+)?)(ms|s|m)")
_SECONDS: Final = {"ms": 0.001, "s": 1.0, "m": 60.0}
_FINGERPRINT: Final = re.compile(r"SHA256:[A-Za-z0-9+/]{43}=?")
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_ALIVE_S: Final = (0.2, 60.0)


class Program(NamedTuple):
    """What runs at the far end."""

    mode: Mode = "shell"
    command: str = ""
    """Of the mode ``exec``."""
    has_pty: bool = True
    """Whether it believes that a person sits there, and so prompts and echoes."""
    environment: tuple[tuple[str, str], ...] = ()


def read_target(setup: Setup) -> Target:
    """Return where to and how to get in; raise `TransportError`."""
    options = setup.options
    username = _text(options, "username")
    if not username:
        raise TransportError("ssh needs a username")
    pinned, file = _text(options, "host_key"), _text(options, "known_hosts")
    if pinned and not _FINGERPRINT.fullmatch(pinned):
        raise TransportError(
            f"ssh: host_key is a fingerprint as 'ssh-keygen -l' prints it, SHA256:…, not {pinned!r}"
        )
    return Target(
        address=_address(options),
        login=Login(
            username=username,
            password=_text(options, "password"),
            key=_text(options, "key"),
            passphrase=_text(options, "passphrase"),
            agent=_options.flag("ssh", options, "agent", default=False),
            legacy=_options.flag("ssh", options, "legacy", default=False),
        ),
        keys=HostKeys(pinned, file),
        alive_every_s=_alive_every(options.get("alive_every", "2s")),
        name=setup.name,
    )


def read_program(setup: Setup) -> Program:
    """Return what runs at the far end; raise `TransportError`."""
    options = setup.options
    mode = _options.choice("ssh", options, "mode", ("shell", "exec", "forward"), "shell")
    command = _options.text("ssh", options, "command")
    if mode == "exec" and not command:
        raise TransportError("ssh: 'mode: exec' needs a command")
    if command and mode != "exec":
        raise TransportError(f"ssh: a command needs 'mode: exec', not 'mode: {mode}'")
    return Program(
        mode=cast(Mode, mode),
        command=command,
        has_pty=_options.flag("ssh", options, "pty", default=mode == "shell"),
        environment=_environment(options.get("environment")),
    )


def _address(options: Mapping[str, object]) -> Address:
    options = {"port": DEFAULT_PORT, **options}
    return Address(_options.host("ssh", options), _options.port("ssh", options))


def _text(options: Mapping[str, object], name: str) -> str:
    """Return a text; what was found is not repeated, it may be a secret."""
    value = options.get(name)
    if value is None:
        return ""
    if not isinstance(value, str):
        raise TransportError(f"ssh: {name} is text; put it in quotation marks")
    return value


def _alive_every(value: object) -> float:
    found = _DURATION.fullmatch(value) if isinstance(value, str) else None
    seconds = float(found[1]) * _SECONDS[found[2]] if found else 0.0
    if not _ALIVE_S[0] <= seconds <= _ALIVE_S[1]:
        raise TransportError(f"ssh: alive_every is a time from 200ms to 1m, not {value!r}")
    return seconds


def _environment(value: object) -> tuple[tuple[str, str], ...]:
    if value is None:
        return ()
    if not isinstance(value, Mapping):
        raise TransportError("ssh: environment is a list of NAME: value")
    pairs = []
    for name, text in value.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise TransportError(f"ssh: {name!r} is no name of an environment variable")
        if not isinstance(text, str):
            raise TransportError(f"ssh: environment.{name} is text; put it in quotation marks")
        pairs.append((name, text))
    return tuple(pairs)
