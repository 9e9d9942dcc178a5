"""Types in frames that are sent: a header of requests is written once, for all commands."""

from pathlib import Path

from tests.dialogue import Dialogue
from urc.config.load import check
from urc.problems import to_text
from urc.runtime.registries import built_in_catalog

MODBUS = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 502
    framing: { type: length, length: { offset: 4, size: 2, adjust: 6 }, payload: { from: 0 } }
    timeouts: { reply: 500ms }
    queue: { in_flight: 4 }
settings:
  unit: { type: integer, default: 17, min: 0, max: 247 }
types:
  header:
    - { id: _id, type: u16be, value: "seq('id', 1, 65535)" }
    - u16be 0
    - { type: u16be, value: "_size - 6" }
    - { id: _unit, type: u8, value: settings.unit }
  values: [u8 _count, { id: registers, type: u16be, count: _count / 2 }]
commands:
  read:
    args:
      first: { type: integer, min: 0, max: 65535 }
      count: { type: integer, min: 1, max: 125 }
    send: { struct: [header, u8 3, u16be first, u16be count] }
    reply: { struct: [header, u8 3, values], match: _id == seq.id }
  write:
    args:
      first: { type: integer, min: 0, max: 65535 }
      level: { type: integer, min: 0, max: 65535 }
    send: { struct: [{ id: head, type: header }, u8 6, u16be first, u16be level] }
    reply: { struct: [header, u8 6, u16be _first, u16be _level], match: _id == seq.id }
signals:
  registers: { type: array, items: integer }
"""


def hexes(sent: list[str]) -> list[str]:
    return [one.encode("latin-1").hex(" ") for one in sent]


def test_a_header_with_a_counter_and_a_setting_is_written_once() -> None:
    """Modbus messaging on TCP/IP: the request of function 3, registers 108 to 110 of unit 17."""
    talk = Dialogue(MODBUS, {"unit": 17}).connect()
    talk.run("read", first=0x6B, count=3)
    talk.run("write", first=1, level=3)
    assert hexes(talk.sent) == [
        "00 01 00 00 00 06 11 03 00 6b 00 03",
        "00 02 00 00 00 06 11 06 00 01 00 03",
    ]
    talk.raw(bytes.fromhex("0002 0000 0006 11 06 0001 0003"))
    talk.raw(bytes.fromhex("0001 0000 0009 11 03 06 022B 0000 0064"))
    assert talk.outcomes == {1: "done", 2: "done"}
    assert talk.values == {"registers": (0x22B, 0, 0x64)}


def test_the_setting_of_a_header_must_exist(tmp_path: Path) -> None:
    """It is looked up like any other."""
    path = tmp_path / "robot.yaml"
    text = MODBUS.replace("value: settings.unit", "value: settings.unti")
    path.write_text(f"urc: 1\nkind: driver\nname: robot\n{text}", "utf-8")
    found = [to_text(one) for one in check(str(path), built_in_catalog()).problems]
    assert any("there is no setting 'unti'" in one for one in found), found
