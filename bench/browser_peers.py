"""Ages of the values that URC, a hand-written page, Node-RED and NiceGUI show.

One robot sends its clock's time over TCP to each of the four dashboards, 50 times a second. A real
Chromium opens one dashboard after another. After each drawn frame, the page measures the age of a
new value on the screen. Node-RED and NiceGUI are installed from npm and PyPI at first use. If a
dashboard can't be installed, it is skipped with a message.
"""

import asyncio
import json
import socket
import statistics
import subprocess
import tempfile
import time
import venv
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from playwright.async_api import Browser, Error

from bench.browser_ages import TooFew, ages
from bench.browser_page import HERE, at_share, opened, running_browser, served
from bench.harness import Result
from bench.rig.programs import Program, peer
from hatch_build import npm_command
from scripts.node import node_executable

__all__ = ["CLOCK", "run"]

ROOT = HERE.parent
STORE = ROOT / "build" / "peers"
RATE_HZ = 50
LOOK_S, LOOK_IF_FULL_S = 2.5, 15.0
ROUNDS, ROUNDS_IF_FULL = 3, 9
TRIES = 2
SLOWEST = 0.99
SETTLE_S = 0.5
START_S = 60.0
HAND, OURS = "by hand", "URC"
NODE_RED = ("node-red@4.1.15", "@flowfuse/node-red-dashboard@1.31.0")
NICEGUI = "nicegui==3.18.0"
VERSIONS = {
    "Node-RED": NODE_RED[0].split("@")[-1],
    "Dashboard": NODE_RED[1].split("@")[-1],
    "NiceGUI": NICEGUI.split("==")[-1],
}
CLOCK = """\
signals:
  t: { type: integer }
messages:
  time: { regex: '^(?P<t>[0-9]+)$' }
widgets:
  t: { use: value, bind: { value: t } }
interfaces:
  default: { grid: "t" }
"""

Ages = dict[str, list[list[float]]]


def run(*, full: bool) -> Sequence[Result]:
    """Compare the medians and the 99th percentiles of the ages."""
    seconds = LOOK_IF_FULL_S if full else LOOK_S
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        work = Path(folder)
        port = stack.enter_context(peer("robot.py", RATE_HZ))
        by_hand = stack.enter_context(peer("plain.py", port))
        addresses = {
            HAND: f"http://127.0.0.1:{by_hand}/",
            OURS: stack.enter_context(served(port, CLOCK, work)),
        }
        for name, start in (("Node-RED", _node_red), ("NiceGUI", _nicegui)):
            try:
                addresses[name] = stack.enter_context(start(port, work))
            except (OSError, subprocess.SubprocessError, AssertionError) as problem:
                _leave_out(name, str(problem))
        taken = asyncio.run(_look_all(addresses, seconds, rounds))
    return _results(taken)


def _leave_out(name: str, why: str) -> None:
    print(json.dumps({"left_out": f"browser_peers {name}", "why": why[:300]}), flush=True)


async def _look_all(addresses: Mapping[str, str], seconds: float, rounds: int) -> Ages:
    taken: Ages = {name: [] for name in addresses}
    async with running_browser(is_whole=True) as browser:
        for _ in range(rounds):
            for name in [*taken]:
                try:
                    taken[name].append(await _look(browser, addresses[name], seconds))
                except (TooFew, Error) as problem:
                    if name in (HAND, OURS):
                        raise SystemExit(f"bench: browser_peers: {name}: {problem}") from problem
                    _leave_out(name, str(problem))
                    del taken[name]
    return taken


async def _look(browser: Browser, address: str, seconds: float) -> list[float]:
    """Return the ages of the shown values; measure again if the page showed too few values."""
    for tries_left in reversed(range(TRIES)):
        async with opened(browser, address) as one:
            await ages(one, SETTLE_S, 0.0)  # it shows values, so it has started
            try:
                return await ages(one, seconds, RATE_HZ)
            except TooFew:
                if tries_left == 0:
                    raise
    raise AssertionError("no measurement was made")


def _results(taken: Ages) -> list[Result]:
    for name, rounds in taken.items():
        every = sorted(age for each in rounds for age in each)
        said = {"p50_ms": at_share(every, 0.5), "p99_ms": at_share(every, 0.99)}
        print(json.dumps({"browser_peers": name, **said, "shown": len(every)}), flush=True)
    results = []
    for share, name in ((0.5, "median"), (SLOWEST, "p99")):
        for other, most in ((HAND, 1.3), ("Node-RED", 1.0), ("NiceGUI", 1.0)):
            is_goal = other != "NiceGUI" or share == SLOWEST
            if other in taken and is_goal:
                title = f"age of a shown value, {name}: URC / {other}"
                results.append(_result(title, most, share, taken[other], taken[OURS]))
    return results


def _result(
    title: str,
    goal: float,
    share: float,
    theirs: Sequence[Sequence[float]],
    ours: Sequence[Sequence[float]],
) -> Result:
    bases = [at_share(sorted(each), share) for each in theirs]
    subjects = [at_share(sorted(each), share) for each in ours]
    ratios = [after / before for before, after in zip(bases, subjects, strict=True)]
    return Result(
        name=title,
        ratio=round(statistics.median(ratios), 3),
        goal=goal,
        baseline_ms=round(statistics.median(bases), 3),
        subject_ms=round(statistics.median(subjects), 3),
        spread=round(max(bases) / statistics.median(bases), 2),
        rounds=len(bases),
        versions=VERSIONS,
    )


@contextmanager
def _node_red(robot_port: int, work: Path) -> Iterator[str]:
    modules = STORE / "node_modules"
    if not (modules / "node-red").is_dir():
        STORE.mkdir(parents=True, exist_ok=True)
        _bring([*npm_command(), "install", "--prefix", str(STORE), "--ignore-scripts", *NODE_RED])
    home = work / "node-red"
    home.mkdir()
    (home / "node_modules").symlink_to(modules)
    (home / "package.json").write_text(
        '{"name": "bench", "version": "1.0.0", "dependencies":'
        ' {"@flowfuse/node-red-dashboard": "*"}}'
    )
    (home / "settings.js").write_text("module.exports = { telemetry: { enabled: false } };\n")
    flows = (HERE / "peers/flows.json").read_text().replace("ROBOT_PORT", str(robot_port))
    (home / "flows.json").write_text(flows)
    port = _free_port()
    node = node_executable() or "node"
    command = [node, str(modules / "node-red/red.js"), "--userDir", str(home)]
    with Program([*command, "--port", str(port), "flows.json"], inside=_in(home)):
        _answers(port)
        yield f"http://127.0.0.1:{port}/dashboard/page"


@contextmanager
def _nicegui(robot_port: int, work: Path) -> Iterator[str]:
    python = STORE / "nicegui" / "bin" / "python"
    if not python.is_file():
        venv.create(STORE / "nicegui", with_pip=True)
        _bring([str(python), "-m", "pip", "install", "--quiet", NICEGUI])
    port = _free_port()
    command = [str(python), str(HERE / "peers/nice.py"), str(robot_port), str(port)]
    with Program(command, inside=_in(work)):
        _answers(port)
        yield f"http://127.0.0.1:{port}/"


def _bring(command: Sequence[str]) -> None:
    subprocess.run(command, check=True, capture_output=True, timeout=600)


def _free_port() -> int:
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        return int(line.getsockname()[1])


def _in(folder: Path) -> list[str]:
    return ["env", "--chdir", str(folder)]


def _answers(port: int) -> None:
    """Wait until the port accepts connections."""
    end_s = time.monotonic() + START_S
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), 1).close()
            return
        except OSError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.2)
