"""The machines of docs/how-to/modbus.md, against a Modbus server that others wrote: pymodbus."""

import asyncio
from pathlib import Path

import pytest
import yaml
from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from tests.documentation import ROOT, blocks
from tests.e2e.dashboards import until
from tests.e2e.ports import free_port
from urc import connect

pytestmark = pytest.mark.anyio

PAGE = ROOT / "docs" / "how-to" / "modbus.md"
UNIT = 1
WANTED, SPEED, TEMPERATURE = 0, 10, 11
"""Registers of the machine on the page."""
WAIT_S = 30


def machine() -> SimDevice:
    """Return a conveyor: 10 mm/s, 23 °C; the wanted speed can be written."""
    values = [0] * 12
    values[SPEED], values[TEMPERATURE] = 100, 230
    return SimDevice(id=UNIT, simdata=[SimData(0, values=values, datatype=DataType.REGISTERS)])


def write_profile(folder: Path, name: str) -> Path:
    """Write a profile of the page to a file."""
    [text] = [
        one.text
        for one in blocks(PAGE)
        if one.text.startswith("urc: 1\n") and yaml.safe_load(one.text)["name"] == name
    ]
    file = folder / f"{name}.yaml"
    file.write_text(text, "utf-8")
    return file


@pytest.mark.parametrize(
    ("name", "framer"), [("conveyor", FramerType.SOCKET), ("conveyor-rtu", FramerType.RTU)]
)
async def test_a_machine_is_read_and_driven(tmp_path: Path, name: str, framer: FramerType) -> None:
    """Registers are read, a held speed is written, and its release writes zero."""
    port = free_port()
    written: list[int] = []

    def keep(is_sending: bool, pdu: object) -> object:
        if not is_sending and getattr(pdu, "function_code", 0) == 6:
            written.extend(getattr(pdu, "registers", []))
        return pdu

    server = ModbusTcpServer(
        machine(),
        framer=framer,
        address=("127.0.0.1", port),
        trace_pdu=keep,  # type: ignore[arg-type]
    )
    await server.serve_forever(background=True)
    settings = (
        {"host": "127.0.0.1", "port": port}
        if name == "conveyor"
        else {"port": f"socket://127.0.0.1:{port}"}
    )
    try:
        async with asyncio.timeout(WAIT_S):
            async with connect(write_profile(tmp_path, name), **settings) as robot:
                assert (await robot.wait_for("speed")).value == pytest.approx(10)
                assert (await robot.wait_for("temperature")).value == pytest.approx(23)
                async with robot.drive() as stick:
                    while 500 not in written:
                        stick(wanted=50.0)
                        await asyncio.sleep(0.05)
            await until(lambda: written[-1] == 0)
    finally:
        await server.shutdown()
