"""What a cell is called where nobody says it: after what the widget is about."""

import pytest

from urc.config.parse.widget import WidgetFolder
from urc.shipped import shipped
from urc.web.show.cells import widget_context
from urc.web.show.demos import demo_states

SHELF = WidgetFolder(shipped("widgets"))


@pytest.mark.parametrize(
    ("name", "inputs", "outputs", "heading"),
    [
        ("camera", ("image",), ("look",), "Image"),
        ("camera", (), ("look",), "Look"),
        ("select", ("state",), ("change",), "Set mode"),
        ("select", ("state",), (), "State"),
        ("alerts", (), (), "Alerts"),
    ],
)
def test_a_cell_is_called_after_what_its_widget_is_about(
    name: str, inputs: tuple[str, ...], outputs: tuple[str, ...], heading: str
) -> None:
    """A command before a signal, but for one that only steers what is looked at."""
    widget = SHELF.get(name)
    assert widget is not None
    state = next(one for one in demo_states(widget) if one.name == "none")
    use = state.use
    use = use._replace(
        title="",
        inputs={one: use.inputs[one] for one in inputs},
        outputs={one: use.outputs[one] for one in outputs},
        lists={},
    )
    assert widget_context(use, widget, state.profile, "cell-0").title == heading
