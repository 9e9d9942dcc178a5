"""Page texts in the user's language, with the English text as key and fallback.

Layer 5. The catalogues are in gettext format (``translations/*.po``), written and checked by
``scripts.translations``. This module reads the compiled catalogues, with one flat table for each
language. The pages' modules import the same table as ``urc/words``, so server and pages use the
same texts.

Texts from a robot's documents, such as signal titles, are not translated.
"""

import json
import re
from collections.abc import Mapping
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send

from urc._translatable import Phrase

__all__ = [
    "COOKIE",
    "LANGUAGES",
    "LanguageMiddleware",
    "address",
    "choose",
    "language",
    "module",
    "spoken",
    "t",
    "table",
]


def spoken(line: str) -> str:
    """Return a `Phrase` as text in the current language; return any other text unchanged."""
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
"""Native name of each language, keyed by BCP 47 tag."""
MOST_WISHES = 20
"""Maximum number of entries read from an Accept-Language header."""

_HOLE = re.compile(r"\{([a-z_]+)\}")

language: ContextVar[str] = ContextVar("urc_language", default="en")
"""Language of the current request, as a BCP 47 tag."""


def t(text: str, /, **names: object) -> str:
    """Return `text` in the current language, with ``{name}`` replaced by `names`."""
    said = table(language.get()).get(text, text)
    return _HOLE.sub(lambda hole: str(names.get(hole[1], hole[0])), said)


@lru_cache(maxsize=len(LANGUAGES))
def table(tag: str) -> Mapping[str, str]:
    """Return the translations of English texts; empty for English or a missing catalogue."""
    place = FOLDER / f"{tag}.json"
    if tag not in LANGUAGES or not place.is_file():
        return {}
    words: dict[str, str] = json.loads(place.read_text(encoding="utf-8"))
    return words


def address(tag: str) -> str:
    """Return the URL of a language's table."""
    return "/static/core/english.js" if tag == "en" else f"/words/{tag}.js"


def module(tag: str) -> str:
    """Return a language's table as a JavaScript module, for `kit.js`."""
    return f"export default {json.dumps(table(tag), ensure_ascii=False)};\n"


def choose(chosen: str, accepted: str) -> str:
    """Return the BCP 47 tag of a user's language.

    `chosen` is the language chosen on the device; "" if no language was chosen. `accepted` is the
    Accept-Language header (RFC 9110, 12.5.4).
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


class LanguageMiddleware:
    """ASGI middleware that sets the language of each request."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Call the application with `language` set for this request."""
        if scope["type"] == "http":
            asked = HTTPConnection(scope)
            accepted = asked.headers.get("accept-language", "")
            language.set(choose(asked.cookies.get(COOKIE, ""), accepted))
        await self._app(scope, receive, send)
