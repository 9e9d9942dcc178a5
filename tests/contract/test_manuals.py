"""The manual pages of the robots: made from their documents, and as they are in the docs."""

from pathlib import Path

import pytest

from scripts.robot_pictures import with_picture
from urc.cli.main import main
from urc.config.load import load_profile
from urc.runtime.manual import manual
from urc.runtime.registries import built_in_catalog

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = sorted(path.stem for path in (ROOT / "robots").glob("*.yaml"))

LAMP = """\
urc: 1
kind: robot
name: lamp
title: A <b>lamp</b> | with `ticks`
summary: "One *lamp*, and [no link](x)."
author: Ada
settings:
  key: { type: string, secret: true, description: From the label. }
  side: { type: choice, choices: [left, right], default: left }
transports:
  wire: { type: tcp, host: lamp, port: 1, framing: { type: delimiter, tx: CRLF, rx: LF } }
signals:
  level:
    type: integer
    states: { "0": "off|dark" }
    limits: { high: 9, hysteresis: 1 }
    stale_after: 2s
commands:
  blink: { title: Blink, description: Three times., role: maintain, send: "B|3 \\t`" }
  set:
    send: "SET {{ level }} {{ side }}"
    args:
      level: { type: integer, min: 0, max: 9, description: How bright. }
      side: { type: string, choices: [a, b], default: a }
messages:
  level: { regex: '^(?P<level>[0-9])$' }
widgets:
  level: { use: value, bind: { value: level } }
interfaces:
  main: { title: Main, tabs: { one: { grid: level } } }
tests:
  - { name: "blinks | thrice", run: blink, sent: { wire: "B|3 \\t`" } }
"""
PAGE = """\
# A \\<b\\>lamp\\</b\\> \\| with \\`ticks\\`

One \\*lamp\\*, and \\[no link\\](x).

## Settings

| setting |  | type | default | allowed |
|---|---|---|---|---|
| `key` | Key | string | secret, to be filled in |  |
| `side` | Side | choice | `left` | `left`, `right` |

- `key`: From the label.

## Connections

| name | type | to | framing | connection |
|---|---|---|---|---|
| `wire` | tcp | host `lamp`, port `1` | delimiter | kept |

## Signals

| signal |  | type | limits | states | stale after |
|---|---|---|---|---|---|
| `level` | Level | integer | warning at or above 9, hysteresis 1 | `0` off\\|dark | 2s |

## Commands

### Blink

Three times.

- name: `blink`
- sends `` B\\|3 \\x09`\\x0d\\x0a ``, in hex `42 7c 33 20 09 60 0d 0a`
- done when the frame is sent
- needs the role maintain

### Set

- name: `set`
- sends `SET {{ level }} {{ side }}`
- done when the frame is sent

| argument |  | type | allowed | default |
|---|---|---|---|---|
| `level` | Level | integer | 0 to 9 | needed |
| `side` | Side | string | `a`, `b` | `a` |

- `level`: How bright.

## Interfaces

### Main

Pages: One.

| slot | widget | shows |
|---|---|---|
| `level` | value | `level` |

## Tests

- blinks \\| thrice

## Licence

By Ada.
"""


@pytest.mark.parametrize("name", ROBOTS)
def test_page_in_the_docs_is_what_the_document_says(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """And a picture; a robot that was changed needs `python -m scripts.robot_pictures NAME`."""
    assert main(["docs", str(ROOT / "robots" / f"{name}.yaml")]) == 0
    page = capsys.readouterr().out
    assert (ROOT / "docs" / "robots" / f"{name}.md").read_text("utf-8") == with_picture(page, name)
    assert (ROOT / "docs" / "images" / "robots" / f"{name}.png").is_file()


def test_page_says_all_that_the_operator_needs(tmp_path: Path) -> None:
    """The whole page; no text of a document can become markup."""
    file = tmp_path / "lamp.yaml"
    file.write_text(LAMP, "utf-8")
    assert manual(load_profile(file, built_in_catalog())) == PAGE


def test_page_says_what_happens_when_control_is_lost(tmp_path: Path) -> None:
    """What the server sends when nobody holds the control any more."""
    file = tmp_path / "lamp.yaml"
    held = LAMP.replace(
        "  blink: {", "  blink: { hold: { repeat: 50ms, release: { } }, confirm: { text: Sure? },"
    ).replace(
        '    send: "SET', '    hold: { repeat: 100ms, release: { level: 0 } }\n    send: "SET'
    )
    file.write_text(held, "utf-8")
    page = manual(load_profile(file, built_in_catalog()))
    assert "- held: sent every 100ms while the control is held\n" in page
    assert "## When control is lost\n\n" in page
    assert "- `set`: `level 0, side a`\n" in page
    assert "  - The document does not state whether the robot stops by itself.\n" in page


def test_page_has_the_alarm_response(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Operators look up cause and action of an alarm, and when it is suppressed."""
    head, tail = LAMP.split("    limits: { high: 9, hysteresis: 1 }\n")
    limits = (
        "    limits: { high: { at: 9, cause: Dirt, action: Clean it. }, suppressed_when: level > 20"
        ", states: { off|dark: { priority: high } } }\n"
    )
    file = tmp_path / "lamp.yaml"
    file.write_text(head + limits + tail, "utf-8")
    assert main(["docs", str(file)]) == 0
    page = capsys.readouterr().out
    assert "### Alarms\n\n| signal | alarm | priority | cause | action | suppressed when |" in page
    assert "| `level` | warning at or above 9 | medium | Dirt | Clean it. | `level > 20` |" in page
    assert "| `level` | off\\|dark | high |  |  | `level > 20` |" in page
