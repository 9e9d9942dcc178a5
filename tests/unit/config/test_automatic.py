"""The look that is made for a profile that says nothing of its own."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.unit.config.folder import WIRE, head
from urc.config.default_look import MOST_PLAIN, automatic_slots, default_interface
from urc.config.load import CheckResult, check
from urc.config.parse.widget import WidgetFolder
from urc.config.resolve import resolve
from urc.model.driver import Argument, Command, Driver
from urc.model.exchange import Hold
from urc.model.interface import Interface, Layout, OutputBinding, Slot, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Signal
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped

ANY = "{ type: [integer, number, boolean, string] }"
NUMBER = "{ type: [integer, number] }"
WIDGETS = {
    "value": f"inputs: {{ value: {ANY} }}",
    "state": f"inputs: {{ value: {ANY} }}",
    "gauge": f"inputs: {{ value: {NUMBER}, target: {{ type: number, required: false }} }}",
    "bar": f"inputs: {{ value: {NUMBER} }}",
    "battery": 'inputs: { level: { type: [integer, number], unit: "%" } }',
    "camera": "inputs: { picture: { type: image } }",
    "map": "inputs: { latitude: { type: number, unit: deg },"
    " longitude: { type: number, unit: deg } }",
    "attitude": "inputs: { roll: { type: number, unit: rad }, pitch: { type: number, unit: rad },"
    " yaw: { type: number, unit: rad, required: false } }",
    "compass": "inputs: { heading: { type: number, unit: deg } }",
    "table": "inputs: { rows: { type: [integer, number, boolean, string], multiple: true } }",
    "button": "outputs: { press: {} }",
    "select": "inputs: { state: { type: string, required: false } }\n"
    "outputs: { change: { arguments: { value: V. } } }",
    "switch": "outputs: { change: { arguments: { value: V. } } }",
    "slider": "inputs: { state: { type: number, unit_of: change, required: false } }\n"
    "outputs: { change: { arguments: { value: V. } } }",
    "text": "outputs: { change: { arguments: { value: V. } } }",
    "joystick": 'outputs: { moved: { hold: true, arguments: { x: X., "y": Y. } } }',
    "axis": "outputs: { moved: { hold: true, arguments: { value: V. } } }",
    "hold-button": "outputs: { held: { hold: true, arguments: { level: L. } } }",
}


def registry(folder: Path, *names: str) -> WidgetFolder:
    """Return a shelf with these of the widgets; all of them by default."""
    for name in names or WIDGETS:
        place = folder / name
        place.mkdir(parents=True, exist_ok=True)
        text = f"urc: 1\nkind: widget\nname: {name}\ntitle: W\nsummary: S.\n{WIDGETS[name]}\n"
        (place / "widget.yaml").write_text(text, "utf-8")
    return WidgetFolder(folder)


def made(folder: Path, *signals: Signal, names: tuple[str, ...] = ()) -> dict[str, str]:
    """Return slot → widget for these signals."""
    driver = Driver(signals={one.name: one for one in signals})
    return {
        slot: use.widget for slot, use in automatic_slots(driver, registry(folder, *names)).items()
    }


def command(name: str, *arguments: Argument, hold: bool = False) -> Command:
    """Return a command that takes these arguments."""
    release = {one.name: 0.0 for one in arguments}
    return Command(
        name,
        "wire",
        WriteSpec("text", {}),
        {one.name: one for one in arguments},
        hold=Hold(0.05, release, 0.25) if hold else None,
    )


def given(folder: Path, one: Command, names: tuple[str, ...] = ()) -> WidgetUse | None:
    """Return what gives a command; None where nothing does."""
    slots = automatic_slots(Driver(commands={one.name: one}), registry(folder, *names))
    return next(iter(slots.values()), None)


@pytest.mark.parametrize(
    ("signal", "widget"),
    [
        (Signal("soc", "integer", unit="%", title="Charge"), "battery"),
        (Signal("load", "number", unit="%", min=0, max=100), "gauge"),
        (Signal("rpm", "number", min=0, max=6000), "gauge"),
        (Signal("rpm", "number", min=0), "value"),
        (Signal("door", "boolean"), "state"),
        (Signal("mode", "integer", states=(("0", "idle"),)), "state"),
        (Signal("name", "string"), "value"),
        (Signal("front", "image"), "camera"),
        (Signal("heading", unit="deg"), "compass"),
    ],
)
def test_a_signal_is_shown_by_what_it_is(tmp_path: Path, signal: Signal, widget: str) -> None:
    """By its type, its range, its unit and its name."""
    assert list(made(tmp_path, signal).values()) == [widget]


def test_what_belongs_together_is_shown_together(tmp_path: Path) -> None:
    """A position on a map, an orientation as a horizon; two of a kind are two."""
    names = ("gps_lat", "gps_lon", "base_lat", "base_lon")
    position = [Signal(name, unit="deg") for name in names]
    turned = [Signal(f"imu_{name}", unit="rad") for name in ("roll", "pitch", "yaw")]
    assert made(tmp_path, *position, *turned) == {
        "gps": "map",
        "base": "map",
        "imu": "attitude",
    }


def test_an_occupancy_grid_is_shown_on_a_map(tmp_path: Path) -> None:
    """With the widgets that ship; a map that takes no grids shows none."""
    floor = Signal("floor", "occupancy_grid", title="Ground floor")
    driver = Driver(signals={"floor": floor})
    (use,) = automatic_slots(driver, WidgetFolder(shipped("widgets"))).values()
    assert (use.widget, use.lists, use.title) == ("map", {"grids": ("floor",)}, "Ground floor")
    assert made(tmp_path, floor) == {}


def test_a_point_cloud_is_shown_in_a_scene(tmp_path: Path) -> None:
    cloud = Signal("cloud", "point_cloud", title="Points")
    driver = Driver(signals={"cloud": cloud})
    (use,) = automatic_slots(driver, WidgetFolder(shipped("widgets"))).values()
    assert (use.widget, use.inputs, use.title) == ("scene3d", {"cloud": "cloud"}, "Points")
    assert made(tmp_path, cloud) == {}


def test_half_a_position_is_two_values(tmp_path: Path) -> None:
    """Or one of them in a unit that is none of an angle."""
    lone = made(tmp_path, Signal("lat", unit="deg"), Signal("lon", unit="V"))
    assert lone == {"lat": "value", "lon": "value"}


def test_widgets_that_are_not_there_are_passed_over(tmp_path: Path) -> None:
    """A plainer one shows it; what nothing shows is left out."""
    signals = (Signal("rpm", min=0, max=9), Signal("front", "image"), Signal("door", "boolean"))
    assert made(tmp_path, *signals, names=("value", "bar")) == {"rpm": "bar", "door": "value"}


def test_hundreds_of_signals_are_rows_of_a_table(tmp_path: Path) -> None:
    """Beyond those that have a cell of their own."""
    signals = [Signal(f"s{number}") for number in range(200)]
    driver = Driver(signals={one.name: one for one in signals})
    slots = automatic_slots(driver, registry(tmp_path))
    assert len(slots) == MOST_PLAIN + 1
    assert len(slots["more"].lists["rows"]) == 200 - MOST_PLAIN


AXES = (Argument("turn", min=-1, max=1), Argument("speed", min=-2, max=2))
CHOICE = Argument("to", "string", choices=("a", "b"))


@pytest.mark.parametrize(
    ("one", "widget", "names"),
    [
        (command("ring"), "button", {}),
        (command("beep", Argument("times", default=2, is_required=False)), "button", {}),
        (command("lamp", Argument("on", "boolean")), "switch", {"on": "value"}),
        (command("mode", CHOICE), "select", {"to": "value"}),
        (command("heat", Argument("c", min=0, max=90)), "slider", {"c": "value"}),
        (command("say", Argument("words", "string")), "text", {"words": "value"}),
        (command("drive", *AXES, hold=True), "joystick", {"speed": "x", "turn": "y"}),
        (command("lift", AXES[1], hold=True), "axis", {"speed": "value"}),
        (command("jog", hold=True), "hold-button", {}),
    ],
)
def test_a_command_is_given_by_what_it_takes(
    tmp_path: Path, one: Command, widget: str, names: Mapping[str, str]
) -> None:
    """Each argument gets what the widget has for it."""
    use = given(tmp_path, one)
    assert use is not None
    assert use.widget == widget
    output = next(iter(use.outputs))
    assert use.outputs[output] == one.name
    assert use.given.get(output, OutputBinding()).names == names


@pytest.mark.parametrize(
    "one",
    [
        command("set", Argument("a"), Argument("b")),
        command("fly", *AXES, Argument("up", min=-1, max=1), hold=True),
    ],
)
def test_what_takes_more_than_any_widget_gives_is_left_to_its_form(
    tmp_path: Path, one: Command
) -> None:
    """Half given, a held command would never move."""
    assert given(tmp_path, one) is None


def test_motion_is_never_given_by_a_tap(tmp_path: Path) -> None:
    """Without a widget that holds there is none, and what is no motion is not held."""
    assert given(tmp_path, command("jog", hold=True), names=("button",)) is None
    assert given(tmp_path / "other", command("ring"), names=("hold-button",)) is None


def test_a_control_shows_what_the_robot_says_of_it(tmp_path: Path) -> None:
    """Where a signal has the name of the command; the two have different slots."""
    driver = Driver(
        signals={"mode": Signal("mode", "string")}, commands={"mode": command("mode", CHOICE)}
    )
    slots = automatic_slots(driver, registry(tmp_path))
    assert {slot: use.widget for slot, use in slots.items()} == {
        "mode": "value",
        "mode-2": "select",
    }
    assert slots["mode-2"].inputs == {"state": "mode"}


def test_names_that_no_grid_can_draw_become_such(tmp_path: Path) -> None:
    """Or the document that `urc resolve` writes would not load."""
    assert list(made(tmp_path, Signal("Left_1"), Signal("left_1"), Signal("_9"))) == [
        "left_1",
        "left_1-2",
        "slot",
    ]


def use(slot: str, widget: str, output: str = "") -> WidgetUse:
    """Return what fills a slot."""
    return WidgetUse(slot, widget, outputs={output: "go"} if output else {})


def test_the_grid_has_the_stick_at_the_bottom_right() -> None:
    """Large views first, and other controls where there is room."""
    uses = (use("a", "value"), use("stick", "joystick", "m"), use("laser", "scan"))
    slots = {one.slot: one for one in (*uses, use("ring", "button", "p"))}
    grids = default_interface(slots, "T").layouts
    assert grids["landscape"] == Layout(
        4,
        4,
        (
            Slot("laser", 0, 0, 2, 2),
            Slot("a", 0, 2),
            Slot("stick", 2, 2, 2, 2),
            Slot("ring", 0, 3),
        ),
    )
    assert [slot.name for slot in grids["phone_portrait"].slots] == ["laser", "a", "ring", "stick"]
    assert grids["phone_portrait"].columns == 2


def test_a_phone_that_lies_has_the_sticks_under_both_thumbs() -> None:
    """In the two rows that are seen, whatever else there is."""
    sticks = (use("drive", "joystick", "m"), use("look", "joystick", "m"))
    shown = (use("laser", "scan"), *(use(f"v{place}", "value") for place in range(8)))
    slots = {one.slot: one for one in (*shown, *sticks)}
    low = default_interface(slots, "T").layouts["phone_landscape"]
    places = {slot.name: slot for slot in low.slots}
    assert places["drive"] == Slot("drive", 0, 5, 2, 2)
    assert places["look"] == Slot("look", 0, 0, 2, 2)
    assert places["laser"] == Slot("laser", 0, 2, 2, 2)
    assert (low.rows, low.columns) == (3, 7)
    few = default_interface({"a": shown[1], "drive": sticks[0]}, "T").layouts["phone_landscape"]
    assert (few.rows, few.columns) == (2, 3)


def test_a_camera_is_the_background_and_sticks_are_in_the_lower_corners() -> None:
    uses = (use("a", "value"), use("map", "map"), use("cam", "camera"), use("ring", "button", "p"))
    sticks = (use("drive", "joystick", "m"), use("look", "joystick", "m"))
    made = default_interface({one.slot: one for one in (*uses, *sticks)}, "T")
    assert made.background == "cam"
    for screen in ("landscape", "phone_landscape"):
        layout = made.layouts[screen]
        places = {slot.name: (slot.row, slot.column) for slot in layout.slots}
        last = layout.rows - 1
        assert (places["drive"], places["look"]) == ((last, 4), (last, 0))
        assert places["a"] == (0, 0)
        assert places["map"] == (0, 4)
        assert 0 < places["ring"][1] < 4
        assert "cam" not in places
        assert {row for row, _ in places.values()} < {*range(layout.rows)}, "no row is empty"
    upright = made.layouts["phone_portrait"]
    assert [slot.name for slot in upright.slots] == ["a", "map", "ring", "look", "drive"]


def test_too_many_widgets_leave_no_background() -> None:
    """They would cover it."""
    many = {f"v{place}": use(f"v{place}", "value") for place in range(15)}
    assert default_interface({"cam": use("cam", "camera"), **many}, "T").background == ""
    assert default_interface({"cam": use("cam", "camera")}, "T").background == ""
    del many["v0"]
    assert default_interface({"cam": use("cam", "camera"), **many}, "T").background == "cam"


DOCUMENT = (
    head("robot", "bot")
    + WIRE
    + "signals:\n  charge: { type: integer, unit: '%' }\n  rpm: { min: 0, max: 9 }\n"
    + "messages: { m: { regex: '^(?P<charge>[0-9]+) (?P<rpm>[0-9]+)$' } }\n"
    + "commands:\n  ring: { send: R }\n  drive:\n    send: '{{ x }} {{ y }}'\n"
    + "    args: { x: { min: -1, max: 1 }, 'y': { min: -1, max: 1 } }\n"
    + "    hold: { repeat: 50ms, release: { x: 0, 'y': 0 } }\n"
)


def loaded(file: Path, folder: Path) -> CheckResult:
    """Return the document as checked with the widgets of the tests."""
    return check(file, built_in_catalog(), registry(folder / "shelf"))


def test_resolve_writes_the_made_look_and_it_loads_as_the_same(tmp_path: Path) -> None:
    """What is shown without a word of the author is what a document would say."""
    file = tmp_path / "bot.yaml"
    file.write_text(DOCUMENT, "utf-8")
    profile = loaded(file, tmp_path).profile
    assert profile is not None
    text = resolve(str(file), registry(tmp_path / "shelf"), profile).text
    assert "URC generated 'widgets' and 'interfaces'" in text
    file.write_text(text, "utf-8")
    again = loaded(file, tmp_path).profile
    assert again is not None
    assert again.slots == profile.slots
    assert ordered(again.interfaces["default"]) == ordered(profile.interfaces["default"])


def ordered(interface: Interface) -> dict[str, tuple[int, int, set[Slot]]]:
    """Return the grids, in whichever order their slots are written."""
    return {
        screen: (grid.rows, grid.columns, set(grid.slots))
        for screen, grid in interface.layouts.items()
    }


@pytest.mark.parametrize(("unit", "inputs"), [("V", {"state": "volts"}), ("mV", {})])
def test_what_the_robot_says_is_shown_beside_only_in_the_same_unit(
    unit: str, inputs: dict[str, str], tmp_path: Path
) -> None:
    """A slider in volts does not show millivolts as volts."""
    argument = Argument("volts", unit="V", min=0, max=24)
    command = Command("set_volts", "wire", WriteSpec("text"), {"volts": argument})
    driver = Driver({}, {"volts": Signal("volts", unit=unit)}, commands={"set_volts": command})
    slots = automatic_slots(driver, registry(tmp_path))
    assert slots["set_volts"].inputs == inputs
