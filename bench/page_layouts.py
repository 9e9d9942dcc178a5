"""Check the layout of every shipped robot's page, on all screens, in all languages and text sizes.

The test `tests/e2e/robots/test_page_layout.py` measures a sample of these pages. An interrupted run
can be continued.
"""

import asyncio
import json
import tempfile
from collections.abc import Mapping, Sequence

from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from tests.e2e.browser import running_browser
from tests.e2e.processes import UrcProcess
from tests.e2e.robots.page_layouts import LANGUAGES, NAMES, SCREENS, TEXT_PX, Variant, measured

__all__ = ["run"]


def run(*, full: bool) -> Sequence[Result]:
    """Measure all pages; without `full`, only the pages with English text in the default size."""
    languages, sizes = (LANGUAGES, TEXT_PX) if full else (LANGUAGES[:1], TEXT_PX[:1])
    kept = Kept(f"page_layouts-{len(languages)}-{len(sizes)}")
    done = {str(row["page"]) for row in kept.rows}
    left = [
        Variant(name, language, text_px, screens)
        for language in languages
        for text_px in sizes
        for name in NAMES
        if (screens := [one for one in SCREENS if _place(name, one, language, text_px) not in done])
    ]
    asyncio.run(_measure(left, kept))
    return _told(kept.end())


def _place(name: str, screen: str, language: str, text_px: int) -> str:
    return f"{name}, {screen}, {language}, {text_px} px"


async def _measure(variants: Sequence[Variant], kept: Kept) -> None:
    with tempfile.TemporaryDirectory() as folder:
        options = ("demo", "--no-browser", "--port", "0")
        process = UrcProcess(options, {"XDG_DATA_HOME": folder})
        try:
            address = (await process.wait_for_async(r"dashboard (http://\S+)", 60.0))[1]
            async with running_browser() as browser:
                async for place, faults in measured(browser, address, variants):
                    kept.add({"page": place, "faults": faults})
        finally:
            process.kill()


def _told(rows: Sequence[Mapping[str, object]]) -> Sequence[Result]:
    bad = [row for row in rows if row["faults"]]
    for row in bad:
        print(json.dumps({"broken": "page_layouts", **row}, ensure_ascii=False), flush=True)
    tell({"figure": "page_layouts", "pages": len(rows), "broken": len(bad)})
    return [
        Result(
            name=f"page layouts: faulty pages of {len(rows)}",
            ratio=float(len(bad)),
            goal=0.0,
            baseline_ms=0.0,
            subject_ms=0.0,
            spread=1.0,
            rounds=len(rows),
        )
    ]
