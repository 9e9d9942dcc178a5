"""The GPS service gpsd as a robot: JSON lines over TCP, once they are asked for.

The receiver is played by datagrams of NMEA 0183, whose check sums and units gpsd reads by itself.
"""

import asyncio
import shutil
import socket
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.programs import listens, program
from urc.client.local import connect

pytestmark = [pytest.mark.anyio, pytest.mark.needs("gpsd")]

WAIT_S = 30.0
SENTENCES = (
    "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
    "GPGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1",
    "GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230324,003.1,W",
)

PROFILE = """
urc: 1
kind: robot
name: gps
title: GPS
summary: Position from gpsd.

settings:
  port: { type: port, default: 2947 }

transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: CRLF }
    on_connect:
      - send: '?WATCH={"enable":true,"json":true};'

signals:
  release: { type: string }
  mode: { type: integer }
  latitude: { type: number, unit: deg }
  longitude: { type: number, unit: deg }
  speed: { type: number, unit: m/s }

messages:
  version: { json: { _class: class, release: release }, when: "_class == 'VERSION'" }
  position:
    json: { _class: class, mode: mode, latitude: lat, longitude: lon, speed: speed }
    when: "_class == 'TPV' and mode >= 2"
"""


def sentence(text: str) -> bytes:
    """Return a sentence of NMEA 0183 with its check sum."""
    total = 0
    for char in text.encode("ascii"):
        total ^= char
    return f"${text}*{total:02X}\r\n".encode("ascii")


async def receiver(port: int) -> None:
    """Say where we are, again and again."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        while True:
            line.sendto(b"".join(map(sentence, SENTENCES)), ("127.0.0.1", port))
            await asyncio.sleep(0.2)


async def test_gps_service_tells_where_we_are(tmp_path: Path) -> None:
    """The stream begins when it is asked for, and other classes of messages are left alone."""
    port, feed = free_port(), free_port()
    profile = tmp_path / "gps.yaml"
    profile.write_text(PROFILE)
    gpsd = shutil.which("gpsd") or "/usr/sbin/gpsd"
    async with program(gpsd, "-N", "-n", "-S", str(port), f"udp://127.0.0.1:{feed}"):
        await listens(port)
        playing = asyncio.create_task(receiver(feed))
        try:
            async with asyncio.timeout(WAIT_S), connect(profile, port=port) as robot:
                async for sample in robot.watch("speed"):
                    if sample.value is not None:
                        break
                found = {name: robot.latest(name) for name in ("release", "latitude", "longitude")}
        finally:
            playing.cancel()
    values = {name: sample.value for name, sample in found.items() if sample is not None}
    assert str(values["release"]).startswith("3.")
    assert values["latitude"] == pytest.approx(48.1173, abs=1e-4)
    assert values["longitude"] == pytest.approx(11.51667, abs=1e-4)
    assert sample.value == pytest.approx(22.4 * 0.514444, abs=0.01)
