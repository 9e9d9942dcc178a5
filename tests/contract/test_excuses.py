"""docs/tests.md names each test that is skipped, repeated, or lenient on a busy machine."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "tests.md").read_text("utf-8")
NAMED = set(re.findall(r"`((?:tests|bench|scripts)/[\w/]+\.py)`", PAGE))
EXCUSE = re.compile(
    r"\bjudged\(|\bunhurried\(|\blateness\(|\.skip\(|skipif|xfail|importorskip"
    r"|busy (machine|browser)|slow machine|machine (is|was|that is) busy|too busy",
    re.IGNORECASE,
)
REPEATS = re.compile(r"reruns|flaky", re.IGNORECASE)


def sources() -> dict[str, str]:
    """Return the text of each module of the tests by its path, except this one."""
    files = (file for file in (ROOT / "tests").rglob("*.py") if file != Path(__file__))
    return {file.relative_to(ROOT).as_posix(): file.read_text("utf-8") for file in files}


def test_the_page_names_each_excuse() -> None:
    """A new excuse needs a reason on the page."""
    excused = {path for path, text in sources().items() if EXCUSE.search(text)}
    assert sorted(excused - NAMED) == []


def test_each_named_file_exists() -> None:
    """A deleted or renamed file leaves the page too."""
    assert [path for path in sorted(NAMED) if not (ROOT / path).is_file()] == []


def test_nothing_repeats_a_failed_test() -> None:
    """Neither a plugin or an option, nor a mark."""
    settings = (ROOT / "pyproject.toml").read_text("utf-8")
    steps = (ROOT / "scripts" / "check.py").read_text("utf-8")
    assert [text for text in (settings, steps) if REPEATS.search(text)] == []
    assert [path for path, text in sources().items() if "mark.flaky" in text] == []
