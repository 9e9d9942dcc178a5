"""Which language a reader gets, and what is said in it."""

import asyncio
from collections.abc import Iterator

import pytest

from urc.web import words

ENGLISH = "Connect to {title}"


@pytest.fixture(autouse=True)
def nobody_else_hears_it() -> Iterator[None]:
    """Give the language back: whichever test comes next reads what its own reader reads."""
    before = words.language.set("en")
    yield
    words.language.reset(before)


@pytest.mark.parametrize(
    ("chosen", "accepted", "expected"),
    [
        ("", "", "en"),
        ("", "de-CH,de;q=0.9,en;q=0.5", "de"),
        ("", "pt,it;q=0.3,fr;q=0.8", "fr"),
        ("", "fr;q=0, it;q=0.1", "it"),
        ("", "fr; q=0.2, it ; q=0.4", "it"),
        ("", "fr;q=nan,it;q=0.1", "it"),
        ("", "zh,*;q=0.1", "en"),
        ("it", "de", "it"),
        ("xx", "de", "de"),
        ("../de", "", "en"),
        ("", ";;;,q=,;q=x," * 5000, "en"),
    ],
)
def test_the_choice_on_the_device_wins_then_the_browsers_wishes(
    chosen: str, accepted: str, expected: str
) -> None:
    assert words.choose(chosen, accepted) == expected


@pytest.mark.parametrize("tag", [tag for tag in words.LANGUAGES if tag != "en"])
def test_names_are_filled_in_and_never_translated(tag: str) -> None:
    words.language.set(tag)
    said = words.t(ENGLISH, title="Puppet {title}")
    assert "Puppet {title}" in said
    assert said != "Connect to Puppet {title}"


def test_what_nobody_translated_is_said_in_english() -> None:
    words.language.set("de")
    assert words.t("{n} frogs", n=3) == "3 frogs"


def test_requests_at_the_same_time_keep_their_own_language() -> None:
    said: list[str] = []

    async def answer(scope: object, receive: object, send: object) -> None:
        await asyncio.sleep(0)
        said.append(words.language.get())

    async def ask(header: bytes) -> None:
        scope = {"type": "http", "headers": [(b"accept-language", header)]}
        await words.LanguageMiddleware(answer)(scope, None, None)  # type: ignore[arg-type]

    async def all_at_once() -> None:
        await asyncio.gather(ask(b"de"), ask(b"fr"), ask(b"it"))

    asyncio.run(all_at_once())
    assert said == ["de", "fr", "it"]
