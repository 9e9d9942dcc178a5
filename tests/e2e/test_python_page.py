"""The programs of docs/python.md run as they stand, at a cart in place of their robots."""

import asyncio
import os
import re
import sys
from pathlib import Path

import pytest

from tests.e2e.open_robots import STOPPED, Cart, carted, served_robot
from urc.testing.entry import KEY

pytestmark = pytest.mark.anyio

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "python.md").read_text("utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
HERE, SERVER, STICK, ALARMS, SYNC = BLOCKS

ALARM_PROGRAM = """
import asyncio
import urc.client

async def main():
    async with urc.client.open("{address}", "cart", token_file="cart.token") as robot:
        while not robot.alarms.active:
            await asyncio.sleep(0.05)
{block}
        while (row := robot.alarms.rows["level"]).state != "shelved":
            await asyncio.sleep(0.05)
        print(row.signal, row.state, row.acknowledged > 0)

asyncio.run(main())
"""


HELD_UP = "MotionEnded: this program was blocked"
"""A stick's error when a busy machine has held up its program."""
MOST_RUNS = 3


async def ran(program: str, cart: Cart, folder: Path) -> str:
    """Run a program to its end while the cart tells its level; return what it prints.

    A program that the machine held up is started again.
    """
    for _ in range(MOST_RUNS):
        code, out, err = await ran_once(program, cart, folder)
        if HELD_UP not in err:
            break
    assert code == 0, err
    return out


async def ran_once(program: str, cart: Cart, folder: Path) -> tuple[int | None, str, str]:
    """Run a program to its end; return its exit code, output and errors."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-c",
        program,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "URC_DATA_DIR": str(folder / "data")},
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    ending = asyncio.create_task(process.communicate())
    while not ending.done():
        cart.say("level 81")
        await asyncio.wait((ending,), timeout=0.1)
    out, err = await ending
    return process.returncode, out.decode(), err.decode()


def at(program: str, *places: tuple[str, str]) -> str:
    """Return the program with the names of the test; each name must stand in it."""
    for name, place in (("battery", "level"), *places):
        assert name in program or name == "battery"
        program = program.replace(name, place)
    return program


async def test_the_robot_in_the_same_process(tmp_path: Path) -> None:
    """It prints the value and its unit."""
    async with carted(tmp_path) as (cart, file):
        program = at(HERE, ('"robots/puppet.yaml", port=6789', repr(str(file))))
        assert await ran(program, cart, tmp_path) == "81 %\n"


@pytest.mark.parametrize("program", [SERVER, SYNC], ids=["async", "sync"])
async def test_the_robot_of_a_server(program: str, tmp_path: Path) -> None:
    """It drives for two seconds, and stops."""
    (tmp_path / "cart.token").write_text(KEY, "ascii")
    async with carted(tmp_path) as (cart, file), served_robot(file) as address:
        program = at(program, ("https://robots.lab:8080", address))
        program = re.sub(r',\s*authority="lab.pem"', "", program)
        assert await ran(program, cart, tmp_path) == ("81\n" if "print" in program else "")
        moves = [(at_s, line) for at_s, line in cart.heard if line == "V 0.3 0"]
        assert moves[-1][0] - moves[0][0] > 1.5
        assert cart.newest("V") == STOPPED


async def test_the_alarms_of_a_server(tmp_path: Path) -> None:
    """A level below its limit is listed, acknowledged and shelved."""
    (tmp_path / "cart.token").write_text(KEY, "ascii")
    async with carted(tmp_path) as (cart, file):
        limits = 'unit: "%", limits: { low: 90, action: Charge it. }'
        file.write_text(file.read_text("utf-8").replace('unit: "%"', limits, 1), "utf-8")
        async with served_robot(file) as address:
            program = ALARM_PROGRAM.format(address=address, block=indented(at(ALARMS)))
            said = (await ran(program, cart, tmp_path)).splitlines()
    assert said == ["level low medium Charge it.", "level shelved True"]


def indented(block: str) -> str:
    """Return the block as the body of the program's innermost `with`."""
    return "".join(f"        {line}\n" for line in block.splitlines())


def test_the_stick_of_the_page_is_python() -> None:
    """A part of a program, which stands in a coroutine."""
    body = "".join(f"    {line}\n" for line in STICK.splitlines())
    compile(f"async def main(robot):\n{body}", "docs/python.md", "exec")
