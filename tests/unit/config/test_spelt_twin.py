"""A driver for a binary line, and its twin that spells the same frames in hex digits."""

from pathlib import Path

from tests.unit.config.folder import Folder, head
from urc.protocol.engine import Engine
from urc.protocol.events import Samples, Send

BINARY = """
transports:
  bus:
    type: tcp
    host: robot
    port: 502
    framing: { type: idle, gap: 20ms, checksum: { algorithm: crc16-modbus, endian: little } }
signals: { level: { type: integer } }
polls:
  - name: level
    every: 1s
    send: { struct: [u8 0x11, u8 3, u16be 0x6B, u16be 3] }
    reply: { struct: [u8 0x11, u8 3, u8 2, u16be level] }
"""
ASCII = """
extends: binary.yaml
transports:
  bus:
    framing: { type: brackets, open: ":", close: CRLF, decode: HEX, checksum: { algorithm: lrc } }
"""


def test_the_ascii_twin_shares_everything_but_the_framing(tmp_path: Path) -> None:
    """Modbus over serial line: the request ``:1103006B00037E``."""
    folder = Folder(tmp_path)
    folder.write(binary=head("driver", "binary") + BINARY, ascii=head("driver", "ascii") + ASCII)
    profile = folder.check("ascii").profile
    assert profile is not None
    engine = Engine(profile.driver, {})
    engine.tick(0.0)
    sent = [one.data for one in engine.start("bus", 0.0) if isinstance(one, Send)]
    assert sent == [b":1103006B00037E\r\n"]
    told = engine.receive("bus", b":1103020005E5\r\n", 0.1)
    assert [one.samples[0].value for one in told if isinstance(one, Samples)] == [5]
