"""Functions that read and check transport options. An invalid option raises a one-line error."""

from collections.abc import Mapping

from urc.transports.base import TransportError

__all__ = ["choice", "flag", "host", "port", "text"]


def host(kind: str, options: Mapping[str, object], key: str = "host") -> str:
    """Return the host name or address in the option `key`.

    Raises:
        TransportError: the option is missing or invalid.
    """
    found = options.get(key)
    if not isinstance(found, str) or not found.strip():
        raise TransportError(f"{kind}: {key} must be a host name or address, not {found!r}")
    return found.strip()


def port(kind: str, options: Mapping[str, object], key: str = "port") -> int:
    """Return the port in the option `key`; the port must be from 1 to 65535.

    Raises:
        TransportError: the option is missing or invalid.
    """
    found = options.get(key)
    if isinstance(found, bool) or not isinstance(found, int) or not 1 <= found <= 65535:
        raise TransportError(f"{kind}: {key} must be an integer from 1 to 65535, not {found!r}")
    return found


def text(kind: str, options: Mapping[str, object], key: str, default: str = "") -> str:
    """Return a text option, or `default` for a missing or empty option.

    Raises:
        TransportError: the option is not text.
    """
    found = options.get(key)
    if found is None or found == "":
        return default
    if not isinstance(found, str):
        raise TransportError(f"{kind}: {key} must be text, not {found!r}")
    return found


def flag(kind: str, options: Mapping[str, object], key: str, *, default: bool) -> bool:
    """Return a boolean option, or `default` for a missing option.

    Raises:
        TransportError: the option is not a boolean.
    """
    found = options.get(key)
    if found is None:
        return default
    if not isinstance(found, bool):
        raise TransportError(f"{kind}: {key} must be true or false, not {found!r}")
    return found


def choice(
    kind: str, options: Mapping[str, object], key: str, among: tuple[str, ...], default: str
) -> str:
    """Return an option that must be a word in `among`, or `default` for a missing option.

    Raises:
        TransportError: the value is not in `among`.
    """
    found = options.get(key)
    if found is None:
        return default
    if found not in among:
        raise TransportError(f"{kind}: {key} must be {' | '.join(among)}, not {found!r}")
    return str(found)
