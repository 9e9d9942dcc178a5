"""Output of subcommands: messages on standard error, and JSON."""

import os
import sys
from collections.abc import Mapping

from urc.problems import printable, printable_json

__all__ = ["complain", "json_text"]


def complain(line: str) -> None:
    """Print one message line to standard error; ignore a closed stream."""
    try:
        print(printable(line), file=sys.stderr, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


def json_text(value: Mapping[str, object], indent: int | None = None) -> str:
    """Return `value` as JSON in standard output's encoding, without control sequences."""
    import json

    takes_all = sys.stdout.encoding.lower().replace("-", "") == "utf8"
    text = json.dumps(value, indent=indent, ensure_ascii=not takes_all, default=_plain)
    return printable_json(text)


def _plain(value: object) -> object:
    """Return a JSON-compatible form of a reading; bytes become base64 text."""
    if isinstance(value, bytes):
        from base64 import b64encode

        return b64encode(value).decode("ascii")
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} has no JSON representation")
