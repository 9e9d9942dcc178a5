"""A URC profile that does the work of `bench.driver_hand`, in an ordinary session."""

import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session

__all__ = ["DeclaredDriver", "declared", "profile"]

DOCUMENT = """
urc: 1
kind: robot
name: bench
settings:
  port: { type: port, default: 6789 }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  volts: { min: 0, max: 60 }
  percent: { type: integer, min: 0, max: 100 }
  x: {}
  y: {}
  heading: {}
  ax: {}
  ay: {}
  az: {}
  gx: {}
  gy: {}
  gz: {}
  left: { min: 0 }
  right: { min: 0 }
  done: { type: integer }
messages:
  bat: { pattern: "BAT {volts:number} {percent:integer}" }
  odo: { pattern: "ODO {x:number} {y:number} {heading:number}" }
  imu:
    pattern: "IMU {ax:number} {ay:number} {az:number} {gx:number} {gy:number} {gz:number}"
  rng: { pattern: "RNG {left:number} {right:number}" }
commands:
  drive:
    send: "VEL {{ (vx * 1000) | fixed(1) }} {{ (wz * 57.3) | fixed(2) }}"
    args: { vx: { min: -1, max: 1 }, wz: { min: -2, max: 2 } }
    reply: { pattern: "ODO {x:number} {y:number} {heading:number}" }
  flood:
    send: "FLOOD {{ count }}"
    args: { count: { type: integer } }
    reply: { pattern: "OK {done:integer}", timeout: 60s }
"""


def profile() -> Profile:
    """Return the benchmark robot's profile, loaded from a temporary file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.yaml"
        path.write_text(DOCUMENT, encoding="utf-8")
        return load_profile(path, built_in_catalog())


class DeclaredDriver:
    """A URC session with the interface of the hand-written drivers."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.hub = session.hub

    async def drive(self, vx: float, wz: float) -> dict[str, object]:
        """Send a speed, and return the robot's reply."""
        return dict((await self._session.command("drive", {"vx": vx, "wz": wz})).values)

    async def flood(self, count: int) -> None:
        """Request `count` lines, and return when all lines have arrived."""
        await self._session.command("flood", {"count": count})


@asynccontextmanager
async def declared(loaded: Profile, port: int) -> AsyncIterator[DeclaredDriver]:
    """Open a session with the robot at `port`; the first command waits for the connection."""
    async with Session(loaded, {"port": port}, built_in_catalog().transports) as session:
        yield DeclaredDriver(session)
