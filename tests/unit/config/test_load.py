"""Documents → model: what a good document becomes, and which pass stops a bad one."""

import subprocess
import sys
from pathlib import Path

import pytest

from urc.config.load import CheckResult, WidgetFolder, check, load_profile
from urc.expressions import compile_template
from urc.model.driver import Backoff, FramingSpec, Timeouts
from urc.model.interface import Layout, Slot, WidgetUse
from urc.model.profile import DocumentTest, Profile
from urc.model.values import AlarmAttributes, AlarmLimits, Signal
from urc.problems import ProblemsError
from urc.runtime.registries import built_in_catalog
from urc.testing.profile import text

ROOT = Path(__file__).resolve().parents[3]
SHELF = ROOT / "tests" / "broken" / "shelf"
HEAD = "urc: 1\nkind: robot\nname: puppet\n"
FRAMING = "framing: { type: delimiter, tx: LF, rx: LF }"
WIRE = f"transports:\n  wire: {{ type: tcp, host: 127.0.0.1, port: 6789, {FRAMING} }}\n"
SIGNALS = 'signals:\n  battery: { type: integer, unit: "%" }\n  mode: { type: string }\n'
MESSAGE = "messages:\n  all: { regex: '^(?P<battery>[0-9]+) (?P<mode>[a-z]+)$' }\n"


@pytest.fixture
def checked(tmp_path: Path) -> "Checker":
    return Checker(tmp_path)


class Checker:
    """Writes documents into one folder and checks one of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write(self, name: str, text: str) -> Path:
        file = self.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
        return file

    def __call__(self, text: str, name: str = "puppet.yaml") -> CheckResult:
        return check(self.write(name, text), built_in_catalog(), WidgetFolder(SHELF))

    def profile(self, text: str) -> Profile:
        result = self(text)
        errors = [one.headline for one in result.problems if one.severity == "error"]
        assert errors == []
        assert result.profile is not None
        return result.profile

    def codes(self, text: str) -> list[str]:
        return [problem.code for problem in self(text).problems]


def test_puppet_becomes_the_model_that_it_describes() -> None:
    """The whole profile of the tutorial, value by value."""
    file = ROOT / "robots" / "puppet.yaml"
    profile = load_profile(file, built_in_catalog(), WidgetFolder(ROOT / "widgets"))
    wire = profile.driver.transports["wire"]
    (poll,) = profile.driver.polls
    discharged = "The battery is discharged."
    assert (profile.name, profile.title, profile.file) == ("puppet", "Puppet", str(file))
    assert profile.settings["port"].default == 6789
    assert wire.options == {
        "host": compile_template("{{ settings.host }}"),
        "port": compile_template("{{ settings.port }}"),
    }
    assert wire.connection == "per_request"
    assert wire.framing == FramingSpec("delimiter", {"tx": b"\n", "rx": b"\n"}, 65536)
    assert (wire.timeouts, wire.backoff) == (Timeouts(), Backoff())
    assert profile.driver.signals["battery"] == Signal(
        name="battery",
        type="integer",
        title="Battery",
        unit="%",
        min=0,
        max=100,
        limits=AlarmLimits(
            lolo=10,
            low=20,
            hysteresis=2,
            attributes=(
                ("lolo", AlarmAttributes("high", discharged, "Charge the Puppet now.")),
                ("low", AlarmAttributes("low", discharged, "Charge the Puppet soon.")),
            ),
        ),
        stale_after_s=3.0,
    )
    assert (poll.name, poll.transport, poll.every_s) == ("polls.0", "wire", 1.0)
    assert poll.send == text("Give me the battery %")
    assert poll.reply is not None
    assert poll.reply.read.fields == ("battery",)
    assert profile.slots["battery"] == WidgetUse(
        "battery", "battery", {"level": "battery"}, options={"show_number": True}
    )
    assert profile.slots["charge"].lists == {"series": ("battery",)}
    assert profile.interfaces["default"].layouts == {
        "landscape": Layout(1, 4, (Slot("battery", 0, 0), Slot("charge", 0, 1, 1, 3))),
        "portrait": Layout(3, 1, (Slot("battery", 0, 0), Slot("charge", 1, 0, 2, 1))),
    }
    assert list(profile.widgets) == ["battery", "plot"]
    (test,) = profile.tests
    assert test == DocumentTest(
        name="a reply sets the battery",
        line=test.line,
        feed={"wire": "42\n"},
        reply_to=0,
        expect={"battery": 42},
        file=str(file),
        column=5,
        source=test.source,
    )
    (rule,) = profile.simulator
    (reaction,) = rule.reactions
    assert reaction.send is not None
    assert reaction.send.options["template"] == compile_template("{{ (now | int) % 100 }}")


@pytest.mark.parametrize(
    ("polls", "seconds"),
    [
        ([], 5.0),
        (["every: 100ms"], 1.0),
        (["every: 1s"], 3.0),
        (["every: 4s", "every: 2s"], 6.0),
    ],
)
def test_age_of_a_signal_follows_its_fastest_poll(
    checked: Checker, polls: list[str], seconds: float
) -> None:
    """Three periods, at least a second; five seconds when no poll sets it."""
    reply = "send: x, reply: { regex: '^(?P<battery>[0-9]+)$' }"
    lines = "".join(f"  - {{ {poll}, {reply} }}\n" for poll in polls)
    profile = checked.profile(
        HEAD + WIRE + SIGNALS + MESSAGE + (f"polls:\n{lines}" if lines else "")
    )
    assert profile.driver.signals["battery"].stale_after_s == seconds


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("LF", b"\n"), ("CRLF", b"\r\n"), ("NUL", b"\0"), ("STX", b"\x02"), ("ETX", b"\x03"),
        ("ESC", b"\x1b"), ("DEL", b"\x7f"), ("0x0D", b"\r"), ("13", b"\r"), ('"0x0D0A"', b"\r\n"),
        ("[ETX, 0x0D, LF]", b"\x03\r\n"), ('"\\r\\n"', b"\r\n"), ('";"', b";"), ("END", b"END"),
        ('"é"', "é".encode()),
    ],
)  # fmt: skip
def test_delimiters_are_written_in_many_ways(checked: Checker, written: str, meant: bytes) -> None:
    """Names, bytes, lists of those, and text."""
    profile = checked.profile(HEAD + WIRE.replace("rx: LF", f"rx: {written}"))
    assert profile.driver.transports["wire"].framing.options["rx"] == meant


@pytest.mark.parametrize(
    ("written", "seconds"),
    [("250ms", 0.25), ("1s", 1.0), ("1.5s", 1.5), ("2m", 120.0), ("1h", 3600)],
)
def test_durations_have_units(checked: Checker, written: str, seconds: float) -> None:
    """All become seconds."""
    profile = checked.profile(HEAD + WIRE + f'polls:\n  - {{ every: {written}, send: "?" }}\n')
    assert profile.driver.polls[0].every_s == seconds


def test_robot_goes_before_its_driver(checked: Checker) -> None:
    """Settings, slots and rules of the same name are the robot's; all tests are kept."""
    rule = "simulator:\n  wire:\n    - { match: '^x$', send: "
    test = "tests:\n  - { name: t, feed: { wire: '1 a' }, expect: { battery: 1 } }\n"
    checked.write(
        "drivers/d.yaml",
        "urc: 1\nkind: driver\nname: d\n"
        "settings:\n  host: { type: host, default: 10.0.0.1 }\n  port: { type: port, default: 1 }\n"
        "transports:\n"
        "  wire: { type: tcp, host: '{{ settings.host }}', port: '{{ settings.port }}',"
        f" {FRAMING} }}\n{SIGNALS}{MESSAGE}"
        "widgets:\n  a: { use: battery, bind: { level: battery }, title: A }\n"
        "  b: { use: value, bind: { value: mode } }\n" + test + rule + "old }\n",
    )  # fmt: skip
    profile = checked.profile(
        HEAD + "driver: drivers/d.yaml\nsettings:\n  port: { type: port, default: 2 }\n"
        "widgets:\n  a: { options: { show_number: false } }\n" + test + rule + "new }\n"
    )
    assert {name: one.default for name, one in profile.settings.items()} == {
        "host": "10.0.0.1",
        "port": 2,
    }
    assert profile.slots["a"] == WidgetUse(
        "a", "battery", {"level": "battery"}, {}, {"show_number": False}, "A"
    )
    assert set(profile.slots) == {"a", "b"}
    assert [Path(one.file).name for one in profile.tests] == ["d.yaml", "puppet.yaml"]
    sent = [one.send for rule in profile.simulator for one in rule.reactions]
    assert [send.options["template"].source for send in sent if send] == ["new"]  # type: ignore[attr-defined]  # of a text


def test_interface_changes_only_what_it_names(checked: Checker) -> None:
    """Widget, bindings and title are the driver's unless the interface gives others."""
    profile = checked.profile(
        HEAD + WIRE + SIGNALS + MESSAGE
        + "widgets:\n  a: { use: battery, bind: { level: battery }, title: A }\n"
        "interfaces:\n  x:\n    grid: a\n    widgets:\n      a: { title: B }\n"
        "  y:\n    grid: a\n    widgets:\n      a: { use: value, bind: { value: mode } }\n"
    )  # fmt: skip
    shown = {"show_number": True}
    assert profile.interfaces["x"].widgets["a"] == WidgetUse(
        "a", "battery", {"level": "battery"}, {}, shown, "B"
    )
    assert profile.interfaces["y"].widgets["a"] == WidgetUse(
        "a", "value", {"value": "mode"}, {}, {}, "A"
    )
    assert profile.slots["a"].title == "A"
    assert sorted(profile.widgets) == ["battery", "value"]


def test_without_an_interface_the_widgets_are_laid_out(checked: Checker) -> None:
    """The driver's slots in their order, not the signals."""
    profile = checked.profile(
        HEAD
        + WIRE
        + SIGNALS
        + MESSAGE
        + "widgets:\n  a: { use: battery, bind: { level: battery } }\n"
    )
    assert profile.interfaces["default"].layouts["landscape"] == Layout(1, 1, (Slot("a", 0, 0),))


@pytest.mark.parametrize(
    ("signals", "wide", "phone", "low"),
    [
        (1, (1, 1), (1, 1), (1, 1)),
        (3, (2, 2), (2, 2), (2, 2)),
        (20, (5, 4), (10, 2), (3, 7)),
    ],
)
def test_without_any_look_each_signal_is_shown(
    checked: Checker,
    signals: int,
    wide: tuple[int, int],
    phone: tuple[int, int],
    low: tuple[int, int],
) -> None:
    """At most four columns, two on a phone, seven on one that lies."""
    names = [f"s{number}" for number in range(signals)]
    profile = checked.profile(
        HEAD + WIRE + "signals:\n" + "".join(f"  {name}: {{ unit: V }}\n" for name in names)
    )
    grids = profile.interfaces["default"].layouts
    assert {name: (grid.rows, grid.columns) for name, grid in grids.items()} == {
        "landscape": wide,
        "phone_portrait": phone,
        "phone_landscape": low,
    }
    assert [slot.name for slot in grids["landscape"].slots] == names
    assert profile.slots["s0"] == WidgetUse("s0", "value", {"value": "s0"}, title="S0")


def test_robot_with_nothing_to_show_has_an_empty_interface(checked: Checker) -> None:
    """There is always one interface."""
    grid = checked.profile(HEAD + WIRE).interfaces["default"].layouts["landscape"]
    assert grid == Layout(1, 1, ())


def test_grid_slots_span_rows_and_columns(checked: Checker) -> None:
    """The picture is read by words, however they are spaced."""
    profile = checked.profile(
        HEAD + WIRE + "interfaces:\n  x:\n    layouts:\n      landscape: |\n        a a .\n"
        "        a   a     b\n      phone_portrait: a\n"
    )  # fmt: skip
    assert profile.interfaces["x"].layouts == {
        "landscape": Layout(2, 3, (Slot("a", 0, 0, 2, 2), Slot("b", 1, 2))),
        "phone_portrait": Layout(1, 1, (Slot("a", 0, 0),)),
    }


def test_poll_is_found_by_its_name_in_tests(checked: Checker) -> None:
    """The model knows polls by their place."""
    poll = "{ name: charge, every: 1s, send: x, reply: { regex: '^(?P<battery>[0-9]+)$' } }"
    profile = checked.profile(
        HEAD + WIRE + SIGNALS + MESSAGE + f"polls:\n  - {poll}\n"
        'tests:\n  - { name: t, feed: { wire: "1" }, reply_to: charge, expect: { battery: 1 } }\n'
    )
    assert profile.tests[0].reply_to == 0


def test_driver_by_itself_is_a_profile(checked: Checker) -> None:
    """So that its own tests can be run."""
    result = checked("urc: 1\nkind: driver\nname: d\n" + WIRE + SIGNALS + MESSAGE)
    assert result.kind == "driver"
    assert result.profile is not None
    assert result.profile.name == "d"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("urc: 1\nkind: interface\nname: x\ngrid: a\n", "interface"),
        ("urc: 1\nkind: interface\nname: x\n", "interface"),
        ("urc: 2\nkind: robot\nname: x\n", ""),
    ],
)
def test_kind_is_told_when_the_document_is_of_one(checked: Checker, text: str, kind: str) -> None:
    """ "" when a first pass stopped."""
    result = checked(text)
    assert (result.kind, result.profile) == (kind, None)


def test_profile_is_refused_with_all_errors_and_no_warning(checked: Checker) -> None:
    """The exception says the first, and how many more there are."""
    file = checked.write("p.yaml", HEAD + WIRE + "widgits: {}\ntitel: x\n")
    with pytest.raises(ProblemsError) as caught:
        load_profile(file, built_in_catalog(), WidgetFolder(SHELF))
    assert [problem.code for problem in caught.value.problems] == ["unknown-key", "unknown-key"]
    assert str(caught.value).endswith("(and 1 more: run 'urc validate')")


def test_interface_is_no_profile(checked: Checker) -> None:
    """`urc serve` on one says so."""
    file = checked.write("i.yaml", "urc: 1\nkind: interface\nname: i\ngrid: a\n")
    with pytest.raises(ProblemsError) as caught:
        load_profile(file, built_in_catalog(), WidgetFolder(SHELF))
    assert caught.value.problems[0].code == "wrong-kind"


@pytest.mark.parametrize(
    ("first", "later"),
    [
        ("a: 1\na: 2\n", "titel: x\n"),  # read before shape
        ("titel: x\n", "commands:\n  go: { send: '{{' }\n"),  # shape before parse
        ("commands:\n  go: { send: '{{' }\n", "polls:\n  - { every: 1s, send: '{{ x }}' }\n"),
        ("polls:\n  - { every: 1s, send: '{{ x }}' }\n", "signals:\n  a: {}\n"),  # link, rules
    ],
)
def test_later_pass_is_silent_when_an_earlier_one_failed(
    checked: Checker, first: str, later: str
) -> None:
    """One fault never shows as three."""
    alone = checked.codes(HEAD + WIRE + first)
    assert alone
    assert checked.codes(HEAD + WIRE + first + later) == alone
    assert checked.codes(HEAD + WIRE + later)


def test_broken_widget_is_told_where_it_stands(checked: Checker, tmp_path: Path) -> None:
    """The robot that uses it is not to blame."""
    manifest = checked.write("gauge/widget.yaml", "urc: 1\nkind: widget\nname: gauge\n")
    robot = checked.write(
        "puppet.yaml", HEAD + WIRE + "widgets:\n  a: { use: gauge }\n  b: { use: gauge }\n"
    )
    result = check(robot, built_in_catalog(), WidgetFolder(tmp_path))
    assert [(one.file, one.code) for one in result.problems] == [(str(manifest), "missing-key")]
    assert result.profile is None


@pytest.mark.parametrize(
    ("make", "code"),
    [
        (lambda path: None, "no-such-file"),
        (lambda path: path.mkdir(), "is-directory"),
        (lambda path: path.write_bytes(b"a: 1\n" * 1_000_000), "too-large"),
        (lambda path: path.write_bytes(b"\n" * 1_000_000), "empty-document"),
    ],
    ids=["missing", "directory", "million lines", "million empty lines"],
)
def test_what_is_no_document_has_one_finding(tmp_path: Path, make: object, code: str) -> None:
    """Line and column 1, as there is nothing else to point at."""
    path = tmp_path / "x.yaml"
    make(path)  # type: ignore[operator]
    (problem,) = check(path, built_in_catalog()).problems
    assert (problem.code, problem.line, problem.column) == (code, 1, 1)


def test_reference_is_followed_from_the_document_that_makes_it(
    checked: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not from the folder one stands in; and findings name files as seen from there."""
    checked.write("robots/drivers/d.yaml", "urc: 1\nkind: driver\nname: d\n" + WIRE + "titel: x\n")
    checked.write("robots/p.yaml", HEAD + "driver: drivers/d.yaml\n")
    monkeypatch.chdir(checked.folder)
    (problem,) = check("robots/p.yaml", built_in_catalog(), WidgetFolder(SHELF)).problems
    assert problem.headline.startswith("robots/drivers/d.yaml:6:1: error unknown-key")


def test_good_document_imports_neither_jsonschema_nor_an_event_loop() -> None:
    """Start-up time is a promise: `urc validate` on a good document stays light."""
    code = (
        "import sys; from urc.config.load import check;"
        "from urc.runtime.registries import built_in_catalog;"
        "assert check('robots/puppet.yaml', built_in_catalog()).problems == ();"
        "print([name for name in ('jsonschema', 'asyncio', 'starlette', 'difflib', 'dataclasses')"
        " if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.stderr, done.stdout.strip()) == ("", "[]")


def test_the_command_of_an_alarm_must_exist(checked: Checker) -> None:
    found = checked(
        HEAD
        + WIRE
        + MESSAGE
        + """
signals:
  battery: { type: integer, limits: { lolo: { at: 10, command: lend } } }
commands:
  land: { send: "land" }
"""
    )
    said = [(one.path, one.hint) for one in found.problems if one.code == "unknown-command"]
    assert said == [("signals.battery.limits.lolo.command", "did you mean 'land'?")]


def test_attributes_of_limits_are_the_defaults_of_each_alarm(checked: Checker) -> None:
    """A limit or state overrides single attributes; the rest comes from the signal's limits."""
    profile = checked.profile(
        HEAD
        + WIRE
        + MESSAGE
        + """
signals:
  battery:
    type: integer
    limits:
      low: { at: 20, priority: low }
      lolo: { at: 10, action: Land., command: land, suppressed_when: mode == 'docked' }
      off_delay: 2s
      cause: It is used.
      suppressed_when: battery == 0
  mode: { type: string, limits: { states: { lost: { priority: high }, idle: {} } } }
commands:
  land: { send: "land" }
"""
    )
    limits = profile.driver.signals["battery"].limits
    assert (limits.low, limits.lolo, limits.off_delay_s) == (20, 10, 2.0)
    low, lolo = limits.attributes_of("low"), limits.attributes_of("lolo")
    assert (low.priority, low.cause, low.action) == ("low", "It is used.", "")
    assert (lolo.priority, lolo.cause, lolo.action) == ("high", "It is used.", "Land.")
    assert (low.command, lolo.command) == ("", "land")
    sources = [one.suppressed_when and one.suppressed_when.source for one in (low, lolo)]
    assert sources == ["battery == 0", "mode == 'docked'"]
    states = profile.driver.signals["mode"].limits
    assert states.states == ("lost", "idle")
    assert [states.attributes_of(one).priority for one in states.states] == ["high", "medium"]
