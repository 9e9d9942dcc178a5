"""Pages of the robots that ship: nothing is cut or covered; the background has its share."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.async_api import Browser

from tests.e2e.processes import UrcProcess
from tests.e2e.robots.page_layouts import LANGUAGES, NAMES, SCREENS, TEXT_PX, Variant, measured
from tests.effort import sampled

pytestmark = pytest.mark.anyio

ROUND = sorted(SCREENS)


ROBOTS = 4
"""Robots in an everyday run; each takes up to 13 s beside other tests."""


def variants() -> list[Variant]:
    """Return each robot once; together, they have every screen, language and size of text.

    The benchmark `page_layouts` measures all combinations.
    """
    found = [
        Variant(
            name,
            LANGUAGES[number % len(LANGUAGES)],
            TEXT_PX[number // len(LANGUAGES) % len(TEXT_PX)],
            [ROUND[(number + step) % len(ROUND)] for step in (0, 2, 3)],
        )
        for number, name in enumerate(NAMES)
    ]
    return sorted(found, key=lambda one: (one.language, one.text_px))


async def test_the_background_fills_the_screen_and_nothing_is_cut_or_covered(
    browser: Browser, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    process = urc_process("demo", "--no-browser", "--port", "0", XDG_DATA_HOME=str(tmp_path))
    address = (await process.wait_for_async(r"dashboard (http://\S+)", 60.0))[1]
    chosen = sampled(variants(), ROBOTS)
    wrong = {place: lines async for place, lines in measured(browser, address, chosen) if lines}
    assert not wrong, json.dumps(wrong, indent=1, ensure_ascii=False)


def test_the_variants_have_every_screen_language_and_size_of_text() -> None:
    chosen = variants()
    assert {screen for one in chosen for screen in one.screens} == set(SCREENS)
    assert {one.language for one in chosen} == set(LANGUAGES)
    assert {one.text_px for one in chosen} == set(TEXT_PX)
    assert {one.name for one in chosen} == set(NAMES)
