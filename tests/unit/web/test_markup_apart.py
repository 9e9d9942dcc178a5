"""Templates of foreign widgets cost another process, whatever they do."""

from pathlib import Path

import pytest

from tests.unit.packages.made import write_package
from urc.config.parse.widget import WidgetFolder
from urc.model.interface import WidgetUse
from urc.testing.dashboard import dashboard_profile
from urc.web import words
from urc.web.load.widget_trust import WidgetTrust
from urc.web.show import isolated_markup
from urc.web.show.cells import render_foreign, widget_cell
from urc.web.show.isolated_markup import markup_of

BOMBS = Path(__file__).parents[2] / "attacks" / "widgets"
NAMES = sorted(folder.name for folder in BOMBS.iterdir())
WELL = ("<b>{{ title }}</b>", {"title": "A & B"})


@pytest.fixture(autouse=True)
def _bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Render everything anew, with less time than there is, so that no test waits long."""
    monkeypatch.setattr(isolated_markup, "_made", {})
    less = (
        "from urc.web.show import isolated_markup; "
        "isolated_markup.PROCESSOR_S = 1; isolated_markup._main()"
    )
    monkeypatch.setattr(isolated_markup, "_COMMAND", ("-P", "-c", less))


def bomb(name: str) -> tuple[str, dict[str, object]]:
    return (BOMBS / name / "template.html.j2").read_text(encoding="utf-8"), {}


@pytest.mark.parametrize("name", NAMES)
def test_a_template_that_takes_for_ever_costs_its_own_cell(name: str) -> None:
    """Time, memory and length are bounded; the others of its page are shown."""
    first, made, last = markup_of([WELL, bomb(name), WELL])
    assert first.html == last.html == "<b>A &amp; B</b>"
    assert made.html == ""
    assert any(word in made.fault for word in ("cannot be rendered", "MemoryError", "65536"))


def test_what_was_rendered_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A failure, too; in another language it is another text."""
    wanted = [("{{ t('Connect') }}", {}), WELL, ("{{ 1 // 0 }}", {})]
    before = markup_of(wanted)
    assert before[2].fault == "ZeroDivisionError: integer division or modulo by zero"
    token = words.language.set("de")
    try:
        assert markup_of(wanted[:1])[0].html == "Verbinden"
    finally:
        words.language.reset(token)
    monkeypatch.setattr(isolated_markup, "_COMMAND", ("-c", "raise SystemExit(1)"))
    assert markup_of(wanted) == before


def test_a_cell_of_a_foreign_widget_is_rendered_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of a page at once; signals are what they are in the page."""
    text = "{{ title }}: {{ inputs.level.unit }} {{ inputs.level.limits.lolo }}"
    home = write_package(tmp_path, "widget", "dial")
    (home / "template.html.j2").write_text(text, encoding="utf-8")
    widget = WidgetFolder(home.parent).get("dial")
    assert widget is not None
    profile = dashboard_profile()
    signal = next(iter(profile.driver.signals))
    use = WidgetUse("dial", "dial", inputs={"level": signal})
    profile = profile._replace(widgets={**profile.widgets, "dial": widget})
    trust = WidgetTrust()
    render_foreign([(use, profile)], trust)
    monkeypatch.setattr(isolated_markup, "_COMMAND", ("-c", "raise SystemExit(1)"))
    there = widget_cell(0, use, profile, trust)
    here = widget_cell(0, use, profile, WidgetTrust.of(["dial"]))
    assert (there.html, there.error) == (here.html, "")
    assert here.html
