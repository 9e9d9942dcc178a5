"""The `urc` command among other programs: browsers, signals, closed pipes, odd names."""

import json
import os
import re
import signal
import socket
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.command_line import PUPPET, TIMEOUT_S, URC, page, run
from tests.e2e.processes import ROOT, UrcProcess

Start = Callable[..., UrcProcess]


# -- the dashboard


@pytest.mark.parametrize(
    "words",
    [
        ("demo", "--no-browser", "--port", "0"),
        ("serve", PUPPET, "--port", "0"),
        ("serve", PUPPET, "--port", "0", "--simulate"),
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_dashboard_comes_up_and_ends(
    words: tuple[str, ...], number: signal.Signals, urc_process: Start
) -> None:
    """It says where it is, is healthy, shows the robot, and gives its port back."""
    dashboard = urc_process(*words)
    url = dashboard.wait_for(r"^dashboard (http://127\.0\.0\.1:(\d+)/)")
    assert json.loads(page(f"{url[1]}healthz"))["status"] == "ok"
    assert "Puppet" in page(url[1])
    assert dashboard.end(number) == 0
    assert dashboard.errors == []
    with socket.create_server(("127.0.0.1", int(url[2]))):
        pass


def test_dashboard_simulates_a_robot_whose_settings_are_missing(
    urc_process: Start, bot: str
) -> None:
    """What only the real robot needs is not asked for."""
    menus = []
    for words in ((), ("--simulate",)):
        dashboard = urc_process("serve", bot, "--port", "0", *words)
        menus.append(page(dashboard.wait_for(r"^dashboard (http://\S+)")[1]))
        assert dashboard.interrupt() == 0
    link = 'href="/robots/bot/"'
    assert [link in menu for menu in menus] == [False, True]


def test_dashboard_that_others_reach_says_so(urc_process: Start) -> None:
    """There is no sign-in yet, so nobody may overlook it."""
    words = ("--host", "0.0.0.0", "--port", "0", "--without-sign-in")
    dashboard = urc_process("serve", PUPPET, *words)
    dashboard.wait_for("^dashboard ")
    assert dashboard.end(signal.SIGTERM) == 0
    assert dashboard.errors == [
        "urc serve: 0.0.0.0 is reachable from other machines without a sign-in:"
        " anyone on the network can drive these robots"
    ]


# -- signals


@pytest.mark.parametrize(
    ("words", "ready", "code"),
    [
        (("watch", PUPPET, "--set", "port=1"), "lost: nothing", None),
        (("simulate", PUPPET, "--set", "port=0"), "listening", 0),
    ],
    ids=["watch", "simulate"],
)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_a_verb_quietly(
    words: tuple[str, ...],
    ready: str,
    code: int | None,
    number: signal.Signals,
    urc_process: Start,
) -> None:
    """A service that was told to stop has done well; a watch reports the signal, as shells do."""
    process = urc_process(*words)
    process.wait_for(ready)
    assert process.end(number) == (128 + number if code is None else code)
    assert not [line for line in process.errors if not line.startswith(("info: ", "warning: "))]


# -- streams, files, surroundings


@pytest.mark.parametrize("redirection", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_change_nothing(redirection: str) -> None:
    """Neither the exit code, nor what goes where."""
    words = " ".join((*URC, "validate", PUPPET, "gone.yaml"))
    done = subprocess.run(
        ["sh", "-c", f"{words} {redirection}"],
        cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    finding = "gone.yaml:1:1: error no-such-file: there is no such file\n"
    summary = "2 documents: 1 error, 0 warnings, 1 of 1 test passed\n"
    assert done.stdout in ("", finding)
    assert done.stderr in ("", summary)
    assert (done.stdout == "") is (">&-" in redirection.split())
    assert (done.stderr == "") is ("2>&-" in redirection)


def test_doctor_finds_this_machine_fit() -> None:
    """Every check is a line; nothing that is needed is missing."""
    done = run("doctor", "--port", "0")
    assert (done.returncode, done.stderr) == (0, "")
    assert {line[:7].strip() for line in done.stdout.splitlines()} <= {"ok", "note"}
    assert re.search(
        r"^ok +robots +\d+ of \d+ shipped robots are valid$", done.stdout, re.MULTILINE
    )


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--help",), 0),
        (("watch", "--help"), 0),
        (("schema", "robot"), 0),
        (("doctor",), 0),
        (("validate", "gone.yaml"), 1),
        (("validate", "gone.yaml", "--format", "json"), 1),
    ],
)
def test_reader_that_has_gone_changes_no_exit_code(words: tuple[str, ...], code: int) -> None:
    """`urc … | true`: findings are findings, and nothing is complained about."""
    reader, writer = os.pipe()
    os.close(reader)
    done = run(*words, stdout=writer)
    os.close(writer)
    assert done.returncode == code
    assert "Broken" not in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a disk that is full")
@pytest.mark.parametrize("words", [("--version",), ("watch", "--help"), ("schema", "robot")])
def test_output_that_cannot_be_written_is_told(words: tuple[str, ...]) -> None:
    """A full disk is a failure, in one line."""
    with open("/dev/full", "w") as full:
        done = run(*words, stdout=full.fileno())
    assert done.returncode == 1
    assert re.fullmatch(r"urc( \w+)?: .*[Nn]o space left on device\n", done.stderr)


def test_names_that_are_no_text_are_told(tmp_path: Path) -> None:
    """Arguments and the environment are bytes; some are not UTF-8."""
    done = run("validate", b"a\xff.yaml", "--format", "json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["problems"][0]["file"] == "a\udcff.yaml"
    done = run("validate", "\u6f22.yaml", "--format", "json", PYTHONIOENCODING="latin-1")
    assert json.loads(done.stdout)["problems"][0]["file"] == "\u6f22.yaml"
    done = run("validate", b"\xe9\xff.yaml", PYTHONIOENCODING="ascii")
    assert done.stdout == r"\udce9\udcff.yaml:1:1: error no-such-file: there is no such file" + "\n"
    done = run("watch", PUPPET, b"\xff")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == r"urc watch: puppet has no signal '\udcff'; it has: battery" + "\n"
    done = run("watch", PUPPET, URC_SET_HOST=b"\xff")
    assert (done.returncode, done.stdout) == (2, "")
    expected = r"urc watch: URC_SET_HOST: '\udcff' is not a host name or an address" + "\n"
    assert done.stderr == expected


def test_bare_surroundings_are_enough(tmp_path: Path) -> None:
    """No home, no terminal, no locale, a working directory that is gone."""
    gone = tmp_path / "gone"
    gone.mkdir()
    command = 'rmdir "$PWD"; exec "$@"'
    done = subprocess.run(
        ["sh", "-c", command, "sh", *URC, "validate", str(ROOT / PUPPET), "x.yaml"],
        cwd=gone, env={"PYTHONPATH": str(ROOT)}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stdout == "x.yaml:1:1: error no-such-file: there is no such file\n"
    assert done.stderr == "2 documents: 1 error, 0 warnings, 1 of 1 test passed\n"
