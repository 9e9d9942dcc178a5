"""What ships keeps far within the bounds that are meant for strangers."""

from pathlib import Path

import pytest

from urc.config.parse.widget import Shelf
from urc.runtime import apart
from urc.runtime.apart import look_apart
from urc.shipped import shipped
from urc.web.load.foreign import OURS
from urc.web.show import markup_apart
from urc.web.show.cells import WidgetContext, widget_context
from urc.web.show.demos import demo_states
from urc.web.show.markup_apart import markup_of
from urc.web.show.sandbox import TEMPLATE

ROBOTS = sorted(shipped("robots").glob("*.yaml"))
TOP = shipped("robots").parent


@pytest.mark.parametrize("document", ROBOTS, ids=lambda one: one.stem)
def test_every_robot_is_looked_at_with_half_of_the_memory_and_time(
    document: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    half = (
        "from urc.runtime import apart;"
        "apart.PROCESSOR_S //= 2; apart.MEMORY_BYTES //= 2; apart._main()"
    )
    monkeypatch.setattr(apart, "COMMAND", ("-P", "-c", half))
    assert look_apart(document, TOP, []).permissions


def test_every_template_of_ours_is_rendered_with_half_of_the_length(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In all states of its demo, by the one process that a page has for all of them."""
    half = (
        "from urc.web.show import markup_apart;"
        "markup_apart.MOST_CHARACTERS //= 2; markup_apart._main()"
    )
    monkeypatch.setattr(markup_apart, "_COMMAND", ("-P", "-c", half))
    monkeypatch.setattr(markup_apart, "_KEPT", 10_000)
    shelf = Shelf(shipped("widgets"))
    wanted = []
    for name in sorted(OURS):
        widget = shelf.get(name)
        assert widget is not None
        source = (widget.folder / TEMPLATE).read_text(encoding="utf-8")
        for state in demo_states(widget):
            context = widget_context(state.use, widget, state.profile, "cell-0")
            variables = {key: getattr(context, key) for key in WidgetContext.__slots__}
            wanted.append((source, variables))
    assert [made.fault for made in markup_of(wanted) if made.fault] == []
