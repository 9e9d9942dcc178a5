"""Mistakes in a demo: each is told at its place, before anything is made of it."""

from pathlib import Path

import pytest

from urc.model.widget import Widget, WidgetPort
from urc.problems import ProblemsError
from urc.web.show.demos import demo_states

DEMO = """\
signals:
  level: { type: number, unit: V }
  series: [{ type: number }, { type: number }]
outputs:
  press: { command: go, arguments: { power: { type: number } } }
states:
  normal:
    values: { level: 1, series: [2, 3] }
    options: { label: Go }
    alarms: { level: low }
    shows: [one]
"""


def lamp(folder: Path) -> Widget:
    """Return the widget of the demo."""
    inputs = {
        "level": WidgetPort("level"),
        "series": WidgetPort("series", is_multiple=True),
        "extra": WidgetPort("extra", is_required=False),
    }
    options = {"label": {"type": "string", "maxLength": 8}}
    return Widget("lamp", "Lamp", folder, inputs, {"press": WidgetPort("press")}, options)


def told(folder: Path, demo: str) -> str:
    """Return the findings about a demo, a line each, without the folder."""
    (folder / "demo.yaml").write_text(demo, "utf-8")
    try:
        demo_states(lamp(folder))
    except ProblemsError as error:
        found = (one.headline.replace(f"{folder}/", "") for one in error.problems)
        return "\n".join(found)
    return ""


def test_the_demo_of_these_tests_is_sound(tmp_path: Path) -> None:
    """Else each of them would find something else."""
    assert told(tmp_path, DEMO) == ""


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        (
            "series: [2, 3] }",
            'series: [{ resolution: 1, rows: ["..", "#"] }, 3] }',
            "demo.yaml:8:25: error bad-value states.normal.values.series: the rows of a grid have"
            " equal lengths and the letters '#. 123456789'",
        ),
        (
            "series: [2, 3] }",
            'series: [{ rows: [".."] }, 3] }',
            "demo.yaml:8:25: error bad-value states.normal.values.series: a grid needs numbers for"
            " resolution, x, y and yaw: 'resolution'",
        ),
        (
            "{ level: 1,",
            "{ levl: 1,",
            "demo.yaml:8:15: error unknown-key states.normal.values.levl",
        ),
        ("    shows:", "    shws:", "demo.yaml:11:5: error unknown-key states.normal.shws"),
        ("  level: {", "  levl: {", "demo.yaml:2:3: error unknown-key signals.levl"),
        ("  press: {", "  pres: {", "demo.yaml:5:3: error unknown-key outputs.pres"),
        ("unit: V", "unti: V", "demo.yaml:2:26: error unknown-key signals.level.unti"),
        ("label: Go", "lable: Go", "demo.yaml:9:16: error unknown-key states.normal.options.lable"),
        ("label: Go", "label: [Go]", "demo.yaml:9:16: error wrong-type"),
        ("level: low", "level: lo", "demo.yaml:10:22: error unknown-word"),
        ("  normal:", "  usual:", "demo.yaml:6:1: error missing-key states: 'normal' is missing"),
        ("states:", "sttes:", "demo.yaml:6:1: error unknown-key sttes"),
        ("[2, 3]", "[2]", "demo.yaml:8:25: error wrong-size states.normal.values.series"),
        ("[2, 3]", "2", "demo.yaml:8:33: error wrong-type states.normal.values.series"),
        ("level: 1,", "level: { picture: [0, 1] },", "demo.yaml:8:15: error bad-value"),
        ("level: 1,", "level: { file: no.png },", "demo.yaml:8:15: error bad-value"),
        ("normal:\n", "normal: {\n", "demo.yaml:"),
        (DEMO, "[]", "demo.yaml:1:1: error wrong-type"),
    ],
)
def test_a_mistake_in_a_demo_is_told_at_its_place(
    tmp_path: Path, before: str, after: str, found: str
) -> None:
    """With line and column, as mistakes in every document."""
    assert told(tmp_path, DEMO.replace(before, after)).startswith(found)


MORE = """\
  low:
    signals: { extra: { type: array, unit: deg } }
    values: { level: 1, extra: [2, 3] }
"""


def test_a_state_binds_an_input_that_the_others_leave_alone(tmp_path: Path) -> None:
    """An input that takes the place of another one is bound where it is shown, and nowhere else."""
    assert told(tmp_path, DEMO + MORE) == ""
    normal, low = demo_states(lamp(tmp_path))
    assert set(normal.use.inputs) == {"level"}
    assert dict(low.use.inputs) == {"level": "level", "extra": "extra"}
    assert low.profile.driver.signals["extra"].unit == "deg"


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        ("signals: { extra", "signals: { extr", "demo.yaml:13:16: error unknown-key states.low"),
        ("unit: deg", "unti: deg", "demo.yaml:13:38: error unknown-key states.low.signals.extra"),
        (MORE, "  low: { values: { extra: [1] } }", "demo.yaml:12:20: error unknown-key"),
    ],
)
def test_a_mistake_in_what_a_state_binds_is_told_at_its_place(
    tmp_path: Path, before: str, after: str, found: str
) -> None:
    """What is bound in one state is unknown in the others."""
    assert told(tmp_path, (DEMO + MORE).replace(before, after)).startswith(found)


def test_a_demo_that_is_missing_is_told(tmp_path: Path) -> None:
    """By the name of the file."""
    with pytest.raises(ProblemsError, match=r"demo\.yaml:1:1: error no-such-file"):
        demo_states(Widget("lamp", "Lamp", tmp_path))
