"""Completion: the words that argcomplete gives bash, and the line that each real shell then has."""

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

SCRIPT = '"$0" -m urc.cli.main 8>&1 9>/dev/null >/dev/null'
PROMPT = "urc-ready> "
TYPED = [
    ("urc dem", "urc demo"),
    ("urc demo --ph", "urc demo --phone"),
    ("urc serve pupp", "urc serve puppet"),
    ("urc serve puz", "urc serve puzzle.yaml"),
    ("urc people inv", "urc people invite"),
]
"""A line, and the same line after a press of Tab: each word has one completion."""
WITHIN_S = 100
"""The end of each wait; a press of Tab starts Python."""


def completed(line: str, folder: Path) -> list[str]:
    """Return the words that complete a line at its end."""
    environment = os.environ | {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_SHELL": "bash", "_ARGCOMPLETE_IFS": "\n",
        "COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9",
        "URC_DATA_DIR": str(folder / "data"),
    }  # fmt: skip
    done = subprocess.run(
        ["bash", "-c", SCRIPT, sys.executable],
        env=environment, cwd=folder, capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    return [word.strip() for word in done.stdout.split("\n") if word.strip()]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a document, and a file that is none."""
    here = tmp_path / "here"
    here.mkdir()
    (here / "puzzle.yaml").write_text("")
    (here / "puzzle.txt").write_text("")
    return here


def test_bash_completes_subcommands_options_and_robots(folder: Path) -> None:
    assert completed("urc dem", folder) == ["demo"]
    assert completed("urc demo --ph", folder) == ["--phone"]
    assert sorted(completed("urc serve pu", folder)) == ["puppet", "puzzle.yaml"]
    assert completed("urc people inv", folder) == ["invite"]


def environment_in(home: Path) -> dict[str, str]:
    """Return the variables of a shell that finds this `urc`, and nothing of the user."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return {
        "PATH": path, "HOME": str(home), "TERM": "xterm", "LANG": "C.UTF-8",
        "ZDOTDIR": str(home), "XDG_CONFIG_HOME": str(home / ".config"),
        "URC_DATA_DIR": str(home / "data"), "RESULT": str(home / "result"),
    }  # fmt: skip


def script_of(shell: str) -> str:
    """Return what `urc completion SHELL` prints."""
    command = [sys.executable, "-m", "urc.cli.main", "completion", shell]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, check=True).stdout


def in_bash(line: str, home: Path, folder: Path) -> str:
    """Return the line after Tab, typed into an interactive bash."""
    script = home / ".local/share/bash-completion/completions/urc"
    script.parent.mkdir(parents=True)
    script.write_text(script_of("bash"))
    start = home / ".bashrc"
    start.write_text(
        f"PS1='{PROMPT}'\nsource {script}\n"
        """bind -x '"\\C-g": printf %s "$READLINE_LINE" > "$RESULT"'\n"""
    )
    return typed(["bash", "--noprofile", "--rcfile", str(start), "-i"], line, home, folder)


def in_zsh(line: str, home: Path, folder: Path) -> str:
    """Return the line after Tab, typed into an interactive zsh."""
    (home / ".zfunc").mkdir()
    (home / ".zfunc" / "_urc").write_text(script_of("zsh"))
    (home / ".zshrc").write_text(
        f"PS1='{PROMPT}'\nfpath=(~/.zfunc $fpath)\nautoload -Uz compinit && compinit -u\n"
        """keep() { print -rn -- "$BUFFER" > "$RESULT" }\nzle -N keep\nbindkey '^G' keep\n"""
    )
    return typed(["zsh", "--no-global-rcs", "-i"], line, home, folder)


def in_fish(line: str, home: Path, folder: Path) -> str:
    """Return the line with the only completion that fish offers for it."""
    script = home / ".config/fish/completions/urc.fish"
    script.parent.mkdir(parents=True)
    script.write_text(script_of("fish"))
    done = subprocess.run(
        ["fish", "--command", "complete --do-complete $argv[1]", line],
        env=environment_in(home), cwd=folder, capture_output=True, text=True, timeout=WITHIN_S,
        check=True,
    )  # fmt: skip
    (offered,) = done.stdout.splitlines()
    return f"{line.rpartition(' ')[0]} {offered.partition(chr(9))[0]}"


def typed(command: list[str], line: str, home: Path, folder: Path) -> str:
    """Type a line, Tab and Ctrl-G into a shell with a terminal; return what Ctrl-G has kept."""
    keyboard, terminal = os.openpty()
    shell = subprocess.Popen(
        ["setsid", "--ctty", *command],
        env=environment_in(home), cwd=folder, stdin=terminal, stdout=terminal, stderr=terminal,
    )  # fmt: skip
    os.close(terminal)
    try:
        until_said(keyboard, PROMPT)
        os.write(keyboard, f"{line}\t\a".encode())
        result = home / "result"
        until_said(keyboard, lambda: result.is_file() and result.read_text() != "")
        return result.read_text().rstrip()
    finally:
        shell.kill()
        shell.wait()
        os.close(keyboard)


def until_said(terminal: int, wanted: str | Callable[[], bool]) -> None:
    """Read a terminal until it has shown a text, or until a condition holds."""
    said = b""
    end = time.monotonic() + WITHIN_S
    while time.monotonic() < end:
        if select.select([terminal], [], [], 0.1)[0]:
            try:
                said += os.read(terminal, 4096)
            except OSError:  # the shell has ended
                break
        if wanted.encode() in said if isinstance(wanted, str) else wanted():
            return
    raise AssertionError(
        f"the shell ended or took {WITHIN_S} s, and said {said.decode(errors='replace')}"
    )


@pytest.mark.parametrize(("line", "whole"), TYPED)
@pytest.mark.parametrize(
    "complete",
    [
        pytest.param(in_bash, id="bash"),
        pytest.param(in_zsh, id="zsh", marks=pytest.mark.needs("zsh")),
        pytest.param(in_fish, id="fish", marks=pytest.mark.needs("fish")),
    ],
)
def test_tab_completes_the_line_in_a_real_shell(
    complete: Callable[[str, Path, Path], str], line: str, whole: str, tmp_path: Path, folder: Path
) -> None:
    """With the script at the place that the page on installation names."""
    assert complete(line, tmp_path, folder) == whole
