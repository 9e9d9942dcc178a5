"""`urc validate --watch`: as a process, over real files, ended by a real signal."""

import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.processes import UrcProcess

DRIVER = """\
urc: 1
kind: driver
name: line
transports:
  wire: { type: tcp, host: robot, port: 1, framing: { type: delimiter, tx: LF, rx: LF } }
signals:
  battery: { type: integer }
messages:
  battery: { regex: '^(?P<battery>[0-9]+)$' }
"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    file = tmp_path / "bot.yaml"
    file.write_text("urc: 1\nkind: robot\nname: bot\ndriver: line.yaml\n")
    return file


def test_watch_checks_again_when_a_document_behind_it_changes(
    urc_process: Callable[..., UrcProcess], robot: Path
) -> None:
    """A missing driver that comes, breaks and is mended; Ctrl-C ends with the last code."""
    process = urc_process("validate", "--watch", str(robot))
    process.wait_for(r"error no-such-file driver: ")
    process.wait_for(r"^watching; Ctrl-C ends it$")
    driver = robot.with_name("line.yaml")
    driver.write_text(DRIVER.replace("integer", "int"))
    process.wait_for(r"line\.yaml:7:20: error unknown-word signals\.battery\.type")
    driver.write_text(DRIVER)
    process.wait_for(r"^changed: .*line\.yaml$")
    process.wait_for(r"^1 document: 0 errors, 0 warnings")
    assert process.end(signal.SIGINT) == 0
    assert not any("Traceback" in line for line in process.errors)


def test_watch_with_json_prints_a_line_for_each_check(
    urc_process: Callable[..., UrcProcess], robot: Path
) -> None:
    """Programs read lines; nothing else is printed."""
    robot.with_name("line.yaml").write_text(DRIVER)
    process = urc_process("validate", "--watch", "--format", "json", str(robot))
    process.wait_for(r'^\{"files": 1, "errors": 0, ')
    robot.write_text(robot.read_text() + "titel: Bot\n")
    process.wait_for(r'^\{"files": 1, "errors": 1, .*unknown-key')
    assert process.end(signal.SIGINT) == 1
    assert process.errors == []
