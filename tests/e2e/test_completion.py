"""Completion, as bash asks for it: by argcomplete's variables, with answers on descriptor 8."""

import os
import subprocess
import sys
from pathlib import Path

SCRIPT = '"$0" -m urc.cli.main 8>&1 9>/dev/null >/dev/null'


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


def test_bash_completes_subcommands_options_and_robots(tmp_path: Path) -> None:
    (tmp_path / "puzzle.yaml").write_text("")
    (tmp_path / "puzzle.txt").write_text("")
    assert completed("urc dem", tmp_path) == ["demo"]
    assert completed("urc demo --ph", tmp_path) == ["--phone"]
    assert sorted(completed("urc serve pu", tmp_path)) == ["puppet", "puzzle.yaml"]
    assert completed("urc people inv", tmp_path) == ["invite"]
