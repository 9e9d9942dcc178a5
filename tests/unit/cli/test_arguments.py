"""What the words of a command line mean, and one line for each way to get them wrong."""

import argparse
from pathlib import Path

import pytest

from urc.cli import arguments as cli_arguments
from urc.cli import demo, doctor, schema, send, serve, simulate, validate, watch
from urc.cli.arguments import duration, parse, port
from urc.cli.main import VERBS
from urc.problems import UrcError

MODULES = {
    "demo": demo, "doctor": doctor, "schema": schema, "send": send, "serve": serve,
    "simulate": simulate, "validate": validate, "watch": watch,
}  # fmt: skip


def parsed(verb: str, *words: str) -> argparse.Namespace:
    found = parse(verb, VERBS[verb], MODULES[verb], list(words))
    assert isinstance(found, argparse.Namespace)
    return found


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("500ms", 0.5), ("5s", 5.0), ("1.5s", 1.5), ("2m", 120.0), ("1h", 3600.0), ("3", 3.0)],
)
def test_duration_is_a_number_with_a_unit(text: str, seconds: float) -> None:
    """A number alone means seconds."""
    assert duration(text) == seconds


@pytest.mark.parametrize("text", ["", "s", "5 s", "-5s", "0s", "0.0", "5d", "1e3", "٣s", "9" * 10])
def test_what_is_no_duration_is_told(text: str) -> None:
    """No time at all, or time backwards, is none either."""
    with pytest.raises(argparse.ArgumentTypeError) as told:
        duration(text)
    assert str(told.value) == f"expected a duration like 500ms, 5s or 2m, found {text!r}"


@pytest.mark.parametrize("text", ["-1", "65536", "", "80 ", "http", "٣", "9" * 5000])
def test_what_is_no_port_is_told(text: str) -> None:
    """The system would take some of them for another port."""
    with pytest.raises(argparse.ArgumentTypeError) as told:
        port(text)
    assert str(told.value) == f"expected a port from 0 to 65535, found {text!r}"
    assert (port("0"), port("65535")) == (0, 65535)


def test_options_may_stand_among_the_words() -> None:
    """Whatever the order, the same is meant."""
    found = parsed("watch", "--for", "5s", "puppet", "--set", "a=1", "battery", "--set", "b=x=y")
    assert (found.profile, found.signals, found.seconds) == ("puppet", ["battery"], 5.0)
    assert found.settings == [("a", "1"), ("b", "x=y")]
    assert parsed("validate", "a", "--strict", "b").paths == ["a", "b"]


WRONG = [
    (("watch",), "the following arguments are required: PROFILE"),
    (("send", "puppet"), "the following arguments are required: COMMAND"),
    (("validate",), "the following arguments are required: PATH"),
    (("watch", "p", "--nope"), "unrecognized arguments: --nope"),
    (("watch", "p", "--wir"), "unrecognized arguments: --wir"),
    (("doctor", "a\nb\x1b"), r"unrecognized arguments: a\x0ab\x1b"),
    (("watch", "p", "--set", "a"), "argument --set: expected NAME=VALUE, found 'a'"),
    (("watch", "p", "--set", "=a"), "argument --set: expected NAME=VALUE, found '=a'"),
    (
        ("serve", "p", "--host", " "),
        "argument --host: expected an address like 127.0.0.1 or 0.0.0.0",
    ),
    (
        ("simulate", "p", "--host", ""),
        "argument --host: expected an address like 127.0.0.1 or 0.0.0.0",
    ),
    (
        ("demo", "--port", "99999"),
        "argument --port: expected a port from 0 to 65535, found '99999'",
    ),
]


@pytest.mark.parametrize(("words", "message"), WRONG)
def test_wrong_use_is_one_line(
    words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """It names what is wrong and where to read more, and the exit code is 2."""
    verb, *rest = words
    assert parse(verb, VERBS[verb], MODULES[verb], rest) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors == f"urc {verb}: {message}; try 'urc {verb} --help'\n"


def test_profile_is_a_path_or_the_name_of_a_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file of that name comes first, a folder of that name does not hide the robot."""
    shipped = tmp_path / "shipped"
    here = tmp_path / "here"
    for folder in (shipped, here / "puppet"):
        folder.mkdir(parents=True)
    (shipped / "puppet.yaml").touch()
    monkeypatch.chdir(here)
    monkeypatch.setattr(cli_arguments, "shipped", lambda _: shipped)
    path = cli_arguments.profile_path
    assert path("puppet") == str(shipped / "puppet.yaml")
    assert path("my/robot") == "my/robot"
    assert path("other.yaml") == "other.yaml"
    (here / "plain").touch()
    assert path("plain") == "plain"
    (here / "folder").mkdir()
    assert path("folder") == "folder"
    for word in ("nobody", "x" * 5000):
        with pytest.raises(UrcError) as told:
            path(word)
        expected = f"no file or robot has the name {word!r}; known robots: puppet"
        assert str(told.value) == expected
