"""Where a setting's value comes from, and who wins."""

import argparse
from collections.abc import Callable
from pathlib import Path

import pytest

from urc.cli.error_report import Misuse
from urc.cli.settings import complete_settings, settings_given
from urc.model.profile import Profile, Setting
from urc.problems import ProblemsError, to_text
from urc.testing.profile import line_profile

Filed = Callable[[str], str]


@pytest.fixture
def filed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Filed:
    """Write a settings file and return its name."""
    monkeypatch.chdir(tmp_path)

    def write(text: str) -> str:
        (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
        return "mine.yaml"

    return write


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("URC_SET_HOST", "URC_SET_PORT", "URC_SET_KEY"):
        monkeypatch.delenv(name, raising=False)


def robot(name: str = "bot", **more: Setting) -> Profile:
    profile = line_profile()
    key = Setting("key", "integer", is_secret=True, default=0)
    return profile._replace(name=name, settings={**profile.settings, "key": key, **more})


def words(*pairs: tuple[str, str], file: str | None = None) -> argparse.Namespace:
    return argparse.Namespace(settings=list(pairs), settings_file=file)


def test_command_line_wins_over_environment_over_file_over_default(
    filed: Filed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each source is asked only for what the ones before it do not say."""
    file = filed("host: filed\nport: 3\nkey: 3\n")
    monkeypatch.setenv("URC_SET_HOST", "environment")
    monkeypatch.setenv("URC_SET_PORT", "2")
    given = settings_given([robot()], words(("host", "typed"), file=file))
    assert given == [({"host": "typed", "port": 2, "key": 3}, ())]
    given = settings_given([robot()], words(("port", "1"), ("port", "4")))
    assert given == [({"host": "environment", "port": 4, "key": 0}, ())]
    monkeypatch.delenv("URC_SET_HOST")
    monkeypatch.delenv("URC_SET_PORT")
    assert settings_given([robot()], words()) == [({"host": "127.0.0.1", "key": 0}, ("port",))]


def test_each_robot_takes_the_settings_that_it_has(filed: Filed) -> None:
    """One command line serves several robots."""
    second = robot("second", extra=Setting("extra", "boolean"))
    file = filed("extra: true\nport: 7\nhost:\n")
    given = settings_given([robot(), second], words(("key", "1"), file=file))
    assert given == [
        ({"host": "127.0.0.1", "port": 7, "key": 1}, ()),
        ({"host": "127.0.0.1", "port": 7, "key": 1, "extra": True}, ()),
    ]


@pytest.mark.parametrize(
    ("names", "pair", "message"),
    [
        (("bot",), ("prot", "1"), "bot has no setting 'prot'; did you mean 'port'?"),
        (("bot", "b"), ("prot", "1"), "no robot has a setting 'prot'"),
        (("bot",), ("port", "0"), "--set port: '0' is not a port from 1 to 65535"),
        (("bot",), ("key", "abc"), "--set key: that is not a whole number"),
    ],
)
def test_wrong_words_are_wrong_use(
    names: tuple[str, ...], pair: tuple[str, str], message: str
) -> None:
    """The line names the word; a secret is not repeated."""
    with pytest.raises(Misuse) as told:
        settings_given([robot(name) for name in names], words(pair))
    assert str(told.value) == message


def test_wrong_environment_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody looks there by himself."""
    monkeypatch.setenv("URC_SET_PORT", "x")
    with pytest.raises(Misuse) as told:
        settings_given([robot()], words())
    assert str(told.value) == "URC_SET_PORT: 'x' is not a port from 1 to 65535"


def test_missing_settings_are_asked_for_by_the_words_to_type() -> None:
    """A profile whose robot needs a setting with no default."""
    with pytest.raises(Misuse) as told:
        complete_settings(robot(name="bot", lock=Setting("lock", "string")), words())
    assert str(told.value) == "bot needs port, lock: add --set port=… --set lock=…"


def test_any_port_is_for_those_who_listen(filed: Filed) -> None:
    """From every source."""
    file = filed("port: 0\n")
    assert settings_given([robot()], words(file=file), allows_any_port=True)[0][0]["port"] == 0
    assert settings_given([robot()], words(("port", "0")), allows_any_port=True)[0][0]["port"] == 0
    with pytest.raises(ProblemsError):
        settings_given([robot()], words(file=file))


@pytest.mark.parametrize(
    ("text", "report"),
    [
        (
            "prot: 1\nport: [1]\nhost: a b\nkey: hunter2\n",
            """\
mine.yaml:1:1: error unknown-setting prot: unknown setting 'prot'; expected one of: host, port, key
    1 | prot: 1
      | ^^^^
mine.yaml:2:1: error wrong-type port: expected text, a number, true or false
    2 | port: [1]
      | ^^^^
mine.yaml:3:7: error wrong-value host: 'a b' is not a host name or an address
    3 | host: a b
      |       ^^^
mine.yaml:4:6: error wrong-value key: that is not a whole number""",
        ),
        (
            "- a\n",
            """\
mine.yaml:1:1: error wrong-type: expected a settings file with lines of the form NAME: VALUE
    1 | - a
      | ^""",
        ),
    ],
)
def test_wrong_settings_file_is_reported_as_documents_are(
    filed: Filed, text: str, report: str
) -> None:
    """All findings at once, with their places; the line of a secret is not shown."""
    with pytest.raises(ProblemsError) as told:
        settings_given([robot()], words(file=filed(text)))
    assert "\n".join(map(to_text, told.value.problems)) == report


def test_missing_settings_file_is_told(filed: Filed) -> None:
    """As every file that is not there."""
    filed("")
    with pytest.raises(ProblemsError) as told:
        settings_given([robot()], words(file="gone.yaml"))
    assert str(told.value) == "gone.yaml:1:1: error no-such-file: there is no such file"


def test_a_secret_that_is_typed_is_warned_of_once(capsys: pytest.CaptureFixture[str]) -> None:
    """Whoever is on this machine reads it in the list of processes; other ways are named."""
    typed = words(("host", "lab"), ("port", "1"), ("key", "7"))
    for _ in range(2):
        settings_given([robot()], typed)
    said = capsys.readouterr().err
    assert said == (
        "warning: --set key=… is visible to every user of this machine in the process list:"
        " use URC_SET_KEY in the environment, or a file with --settings\n"
    )


def test_a_secret_from_elsewhere_is_not_warned_of(
    filed: Filed, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("URC_SET_KEY", "2")
    settings_given([robot()], words(("port", "1"), file=filed("key: 3\n")))
    assert capsys.readouterr().err == ""
