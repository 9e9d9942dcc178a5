"""The words that pages show, in the reader's language; English is the key and the fall-back.

Floor 5. The catalogues are gettext's (``translations/*.po``, written and checked by
``scripts.translations``); what is read here is their compiled form, one flat table a language. The
same table goes to the page's modules as ``urc/words``, so both sides say the same.

Words of a robot's own documents (titles of signals, names of commands) are its author's, and stay.
"""

import json
import re
from collections.abc import Mapping
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send

from urc._phrases import Phrase

__all__ = [
    "COOKIE",
    "LANGUAGES",
    "Reader",
    "address",
    "choose",
    "language",
    "module",
    "spoken",
    "t",
    "table",
]


def spoken(line: str) -> str:
    """Return a line in the current language; what is no phrase stays as it is."""
    if not isinstance(line, Phrase):
        return line
    if line.pieces:
        return line.between.join(map(spoken, line.pieces))
    return t(line.text, **{name: spoken(one) for name, one in line.names.items()})


FOLDER = Path(__file__).resolve().parent / "translations"
COOKIE = "urc-language"
LANGUAGES: Mapping[str, str] = {
    "en": "English",
    "de": "Deutsch",
    "fr": "Français",
    "it": "Italiano",
}
"""BCP 47 tag → what its speakers call it."""
MOST_WISHES = 20
"""How many entries of an Accept-Language header are looked at."""

_HOLE = re.compile(r"\{([a-z_]+)\}")

language: ContextVar[str] = ContextVar("urc_language", default="en")
"""Of the page that is being made."""


def t(text: str, /, **names: object) -> str:
    """Return `text` in the current language, with ``{name}`` replaced by `names`."""
    said = table(language.get()).get(text, text)
    return _HOLE.sub(lambda hole: str(names.get(hole[1], hole[0])), said)


@lru_cache(maxsize=len(LANGUAGES))
def table(tag: str) -> Mapping[str, str]:
    """Return English → the language; empty for English and for what nobody translated."""
    place = FOLDER / f"{tag}.json"
    if tag not in LANGUAGES or not place.is_file():
        return {}
    words: dict[str, str] = json.loads(place.read_text(encoding="utf-8"))
    return words


def address(tag: str) -> str:
    """Return where pages find the table of a language."""
    return "/static/core/english.js" if tag == "en" else f"/words/{tag}.js"


def module(tag: str) -> str:
    """Return the table as a JavaScript module, for `kit.js`."""
    return f"export default {json.dumps(table(tag), ensure_ascii=False)};\n"


def choose(chosen: str, accepted: str) -> str:
    """Return the language for a reader.

    Args:
        chosen: what was picked on this device; "" where nothing was.
        accepted: the Accept-Language header (RFC 9110, 12.5.4).
    """
    if chosen in LANGUAGES:
        return chosen
    wishes = sorted(map(_wish, accepted.split(",")[:MOST_WISHES]), key=lambda wish: -wish[1])
    for tag, weight in wishes:
        known = tag.partition("-")[0].lower()
        if weight > 0 and known in LANGUAGES:
            return known
    return "en"


def _wish(text: str) -> tuple[str, float]:
    tag, _, weight = text.partition(";")
    try:
        return tag.strip(), float(weight.strip().removeprefix("q=") or 1)
    except ValueError:
        return tag.strip(), 0.0


class Reader:
    """An ASGI layer that finds out which language the reader wants."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand on, with `language` set for this one request."""
        if scope["type"] == "http":
            asked = HTTPConnection(scope)
            accepted = asked.headers.get("accept-language", "")
            language.set(choose(asked.cookies.get(COOKIE, ""), accepted))
        await self._app(scope, receive, send)
