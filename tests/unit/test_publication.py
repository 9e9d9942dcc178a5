"""What is to be filled in before URC is published: found, and on one page."""

from pathlib import Path

import pytest

from scripts.publication import PAGE, URLS, missing_values

ROOT = Path(__file__).resolve().parents[2]
FILES = {
    "pyproject.toml": "[project]\nurls = { "
    + ", ".join(f'{name} = "https://urc.example/"' for name in URLS)
    + " }\n",
    "packaging/debian/control": "Source: urc\nMaintainer: Ann Lee <ann@urc.example>\n",
    "CHANGELOG.md": "## [0.1.0] - 2026-11-29\n\nThe first version.\n",
    "docs/install/index.md": "# Install\n",
}
"""A checkout in which everything is filled in."""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    return tmp_path


def test_nothing_is_missing_when_all_is_filled_in(root: Path) -> None:
    assert list(missing_values(root, "0.1.0")) == []


@pytest.mark.parametrize(
    ("file", "before", "after", "said"),
    [
        ("pyproject.toml", "Issues", "Homepage", "has no URL for Issues"),
        ("packaging/debian/control", "urc.example", "urc.invalid", "ann@urc.invalid is not a real"),
        ("CHANGELOG.md", " - 2026-11-29", "", "the heading of 0.1.0 has no date"),
        (
            "docs/install/index.md",
            "# Install\n",
            "URC is not yet on the Python package index.\n",
            "states that URC is not yet on the Python package index",
        ),
    ],
)
def test_a_missing_value_is_named_with_its_file(
    root: Path, file: str, before: str, after: str, said: str
) -> None:
    (root / file).write_text(FILES[file].replace(before, after), "utf-8")
    (line,) = missing_values(root, "0.1.0")
    assert line.startswith(f"{file}: ")
    assert said in line


def test_the_page_names_every_file_with_a_missing_value() -> None:
    """Readers find all of it in one place."""
    page = (ROOT / PAGE).read_text("utf-8")
    places = {"docs/install/index.md": "(../install/index.md)"}
    for file in FILES:
        assert places.get(file, f"`{file}`") in page
    assert all(f"{name} = " in page for name in URLS)
