"""Debian's Prometheus reads the metrics of a server, with the configuration of the page."""

import asyncio
import json
import re
import shutil
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import urllib3

import urc.client
from tests.e2e.command_line import run
from tests.e2e.keys import with_key
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess

pytestmark = pytest.mark.anyio

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "how-to" / "metrics.md"
WAIT_S = 60.0


def block(start: str) -> str:
    """Return the YAML block of the page that begins with a key, without its indentation."""
    for found in re.finditer(r"^( *)```yaml\n(.*?)^ *```", PAGE.read_text("utf-8"), re.M | re.S):
        text = "\n".join(line.removeprefix(found[1]) for line in found[2].splitlines())
        if text.startswith(start):
            return text
    raise AssertionError(start)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[tuple[str, str]]:
    """Return the address and the start key of a server with an emulated robot."""
    words = ("serve", "puppet", "--simulate", "--metric", "*.battery", "--port", "0")
    process = UrcProcess((*words, "--data-dir", str(tmp_path / "data")), {})
    try:
        address = with_key(process.wait_for(r"dashboard (http\S+)")[1])
        url, _, key = address.partition("/?key=")
        yield url, key
    finally:
        process.kill()


@asynccontextmanager
async def prometheus(folder: Path, target: str) -> AsyncIterator[str]:
    """Run Prometheus with the page's configuration; yield its address."""
    text = block("scrape_configs:").replace("localhost:8080", target).replace("15s", "1s")
    (folder / "prometheus.yml").write_text(f"{text}\nrule_files: [rules.yml]\n", "utf-8")
    (folder / "rules.yml").write_text(block("groups:"), "utf-8")
    address = f"127.0.0.1:{free_port()}"
    program = shutil.which("prometheus")
    assert program is not None
    log = (folder / "prometheus.log").open("w")
    process = await asyncio.create_subprocess_exec(
        *(program, f"--config.file={folder / 'prometheus.yml'}"),
        *(f"--storage.tsdb.path={folder / 'store'}", f"--web.listen-address={address}"),
        cwd=folder,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=log,
    )
    try:
        yield f"http://{address}"
        assert process.returncode is None, (folder / "prometheus.log").read_text()
    finally:
        process.terminate()
        await process.wait()
        log.close()


async def queried(url: str, expression: str) -> list[dict[str, Any]]:
    """Return the result of a query, as soon as there is one."""
    end_s = time.monotonic() + WAIT_S
    while True:
        assert time.monotonic() < end_s, expression
        try:
            reply = await asyncio.to_thread(
                urllib3.request, "GET", f"{url}/api/v1/query", fields={"query": expression},
                retries=False,
            )  # fmt: skip
        except urllib3.exceptions.HTTPError:
            await asyncio.sleep(0.2)
            continue
        found: list[dict[str, Any]] = json.loads(reply.data).get("data", {}).get("result", [])
        if found:
            return found
        await asyncio.sleep(0.2)


@pytest.mark.needs("prometheus")
async def test_prometheus_reads_the_metrics(tmp_path: Path, server: tuple[str, str]) -> None:
    """A token reads them; the robot stays asleep until somebody looks at it."""
    url, key = server
    made = run(
        "tokens", "add", "Prometheus", "--role", "watch", "--data-dir", str(tmp_path / "data")
    )
    assert made.returncode == 0, made.stderr
    (tmp_path / "urc-token").write_text(made.stdout.strip(), "utf-8")
    async with prometheus(tmp_path, url.removeprefix("http://")) as monitor:
        (up,) = await queried(monitor, "up == 1")
        assert up["metric"]["job"] == "urc"
        (asleep,) = await queried(monitor, "urc_robot_session_open")
        assert asleep["value"][1] == "0"
        async with urc.client.open(url, "puppet", token=key, timeout=WAIT_S) as robot:
            await robot.wait_for("battery", timeout=WAIT_S)
            (reading,) = await queried(monitor, "urc_reading_battery_percent")
            assert reading["metric"]["robot"] == "puppet"
            assert 0 <= float(reading["value"][1]) <= 100
            await queried(monitor, "urc_robot_session_open == 1")
        assert await queried(monitor, "process_resident_memory_bytes > 1e6")
        reply = await asyncio.to_thread(urllib3.request, "GET", f"{monitor}/api/v1/rules")
        rules = json.loads(reply.data)["data"]["groups"][0]["rules"]
        assert [one["name"] for one in rules] == ["RobotLost", "BatteryLow"]


async def test_a_wrong_choice_is_one_line() -> None:
    """The command says what it expects."""
    done = await asyncio.to_thread(run, "serve", "puppet", "--simulate", "--metric", "battery")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--metric: expected ROBOT.SIGNAL" in done.stderr
