"""The sources of the site: every page is in a table of contents, and hooks for scripts exist."""

from pathlib import Path

from tests.documentation import ROOT

DOCS = ROOT / "docs"


def test_the_front_page_has_four_doors() -> None:
    """For robots by protocol, ROS, drones, and for those who just look."""
    text = (DOCS / "index.md").read_text("utf-8")
    for page in ("tutorials/cart", "how-to/ros2", "how-to/drone", "tutorials/first-drive"):
        assert f":link: {page}\n" in text
        assert (DOCS / f"{page}.md").is_file()


def test_pictures_of_the_pages_are_used() -> None:
    """A picture that no page shows is left over."""
    text = "".join(page.read_text("utf-8") for page in sorted(DOCS.rglob("*.md")))
    text += (ROOT / "README.md").read_text("utf-8")
    found = [path for path in (DOCS / "images").rglob("*.png") if path.name not in text]
    assert [str(Path(path).relative_to(DOCS)) for path in found] == []
