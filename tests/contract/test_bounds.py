"""What ships keeps far within the bounds that are meant for strangers."""

from pathlib import Path

import pytest

from urc.config.parse.widget import WidgetFolder
from urc.runtime import isolation
from urc.runtime.isolation import look_apart
from urc.shipped import shipped
from urc.web.load.widget_trust import OURS
from urc.web.show import isolated_markup
from urc.web.show.cells import WidgetContext, widget_context
from urc.web.show.demos import demo_states
from urc.web.show.isolated_markup import markup_of
from urc.web.show.sandbox import TEMPLATE

ROBOTS = sorted(shipped("robots").glob("*.yaml"))
TOP = shipped("robots").parent


@pytest.mark.cases(3)
@pytest.mark.parametrize("document", ROBOTS, ids=lambda one: one.stem)
def test_every_robot_is_looked_at_with_half_of_the_memory_and_time(
    document: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    half = (
        "from urc.runtime import isolation;"
        "isolation.PROCESSOR_S //= 2; isolation.MEMORY_BYTES //= 2; isolation._main()"
    )
    monkeypatch.setattr(isolation, "COMMAND", ("-P", "-c", half))
    assert look_apart(document, TOP, []).permissions


def test_every_template_of_ours_is_rendered_with_half_of_the_length(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In all states of its demo, by the one process that a page has for all of them."""
    half = (
        "from urc.web.show import isolated_markup;"
        "isolated_markup.MOST_CHARACTERS //= 2; isolated_markup._main()"
    )
    monkeypatch.setattr(isolated_markup, "_COMMAND", ("-P", "-c", half))
    monkeypatch.setattr(isolated_markup, "_KEPT", 10_000)
    registry = WidgetFolder(shipped("widgets"))
    wanted = []
    for name in sorted(OURS):
        widget = registry.get(name)
        assert widget is not None
        source = (widget.folder / TEMPLATE).read_text(encoding="utf-8")
        for state in demo_states(widget):
            context = widget_context(state.use, widget, state.profile, "cell-0")
            variables = {key: getattr(context, key) for key in WidgetContext.__slots__}
            wanted.append((source, variables))
    assert [made.fault for made in markup_of(wanted) if made.fault] == []
