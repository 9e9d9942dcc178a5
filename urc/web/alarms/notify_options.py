"""The options file that defines the maintainer's hook for alarm notifications.

Layer 5. A webhook's URL is often a secret, so it can be stored in a separate file that only the
file's owner can read.
"""

from dataclasses import dataclass, field
from typing import Any, Final, cast, get_args

import httpx2

from urc.access.options_file import OptionsFile, is_loopback_host
from urc.model.values import AlarmPriority

__all__ = ["KEYS", "NotifyOptions", "read_notify_options"]

KEYS: Final = (
    "command", "url", "url_file", "secret_file", "priority", "returned", "timeout_s", "tries",
)  # fmt: skip
"""All keys that the options file may contain."""
_MOST_WORDS: Final = 50
_LONGEST_S: Final = 60.0
_MOST_TRIES: Final = 5


@dataclass(frozen=True, slots=True)
class NotifyOptions:
    """The maintainer's hook for alarm notifications: a command or a URL."""

    command: tuple[str, ...] = ()
    """Program and arguments; the program reads the notification as JSON from standard input."""
    url: str = field(default="", repr=False)
    """URL to which notifications are posted as JSON."""
    secret: str = field(default="", repr=False)
    """Secret sent as ``Authorization: Bearer``; "" to omit the header."""
    priority: AlarmPriority = "medium"
    """Lowest alarm priority that causes a notification."""
    has_returned: bool = False
    """Whether to also send a notification when an alarm returns to normal."""
    timeout_s: float = 10.0
    """Maximum duration of one attempt to notify, in seconds."""
    tries: int = 3

    @property
    def place(self) -> str:
        """Hook as it appears in logs: the program, or only the URL's scheme and host."""
        if self.command:
            return self.command[0]
        url = httpx2.URL(self.url)
        return f"{url.scheme}://{url.host}"


def read_notify_options(file: str) -> NotifyOptions:
    """Read the options file and return its options.

    Raises:
        ProblemsError: the file cannot be read, or has an error.
    """
    given = OptionsFile(file, KEYS)
    ways = [key for key in ("command", "url", "url_file") if key in given.data]
    if len(ways) != 1:
        raise given.fault((), "expected exactly one of command, url and url_file", "missing-key")
    is_command = ways == ["command"]
    if is_command and "secret_file" in given.data:
        text = "'secret_file' needs a URL; a command must read its own secrets"
        raise given.fault(("secret_file",), text, is_key=True)
    priority = given.text("priority", "medium")
    if priority not in get_args(AlarmPriority):
        raise given.fault(("priority",), f"expected low, medium or high, found {priority!r}")
    return NotifyOptions(
        command=_command(given) if is_command else (),
        url="" if is_command else _url(given, ways[0]),
        secret=given.secret("secret_file"),
        priority=cast("AlarmPriority", priority),
        has_returned=_flag(given, "returned"),
        timeout_s=_number(given, "timeout_s", 10.0, _LONGEST_S),
        tries=int(_number(given, "tries", 3, _MOST_TRIES)),
    )


def _command(given: OptionsFile) -> tuple[str, ...]:
    words: list[Any] = given.list_of("command")
    is_text = all(isinstance(one, str) and "\0" not in one for one in words)
    if not is_text or not words or not words[0] or len(words) > _MOST_WORDS:
        text = f"expected a list of 1 to {_MOST_WORDS} strings: the program and its arguments"
        raise given.fault(("command",), text, "wrong-type")
    return tuple(words)


def _url(given: OptionsFile, key: str) -> str:
    text = given.text("url") if key == "url" else given.secret("url_file")
    try:
        url = httpx2.URL(text)
    except httpx2.InvalidURL:
        url = httpx2.URL("")
    if url.scheme not in ("http", "https") or not url.host or url.userinfo:
        raise given.fault((key,), "expected a URL such as https://hooks.example/alarms")
    if url.scheme == "http" and not is_loopback_host(url.host):
        raise given.fault((key,), "expected https:, because http: is not encrypted")
    return text


def _flag(given: OptionsFile, key: str) -> bool:
    value = given.data.get(key, False)
    if not isinstance(value, bool):
        raise given.fault((key,), f"expected true or false, found {value!r}", "wrong-type")
    return value


def _number(given: OptionsFile, key: str, usual: float, most: float) -> float:
    value = given.data.get(key, usual)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 1 <= value <= most:
        raise given.fault((key,), f"expected a number from 1 to {most:g}, found {value!r}")
    return float(value)
