"""STOP ALL over two servers in processes of their own, with two carts each, over Zenoh and TLS."""

import asyncio
import json
import signal
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.command_line import run
from tests.e2e.fleet.two_sites import WAIT_S, Site, TwoSites
from urc.runtime.audit_search import AuditQuery, search

pytestmark = pytest.mark.anyio

CART = """\
urc: 1
kind: robot
name: NAME
tags: [carts]
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
    stale_after: 60s
signals:
  speed: { type: number, unit: m/s }
messages:
  said: { regex: '^v (?P<speed>[0-9.]+)$' }
commands:
  drive:
    args: { speed: { type: number, min: 0, max: 1, default: 0 } }
    send: "drive {{ speed }}"
    hold: { repeat: 50ms, release: { speed: 0 } }
polls:
  - { every: 200ms, send: "v?" }
simulator:
  wire:
    - { match: '^v\\?$', send: "v 0" }
"""
NAMES = ("cart-1", "cart-2")
LONGEST_S = 1.0
"""Longest time until the reply, whichever site is frozen."""


@pytest.fixture
async def sites(tmp_path: Path) -> AsyncIterator[TwoSites]:
    """Run both servers; zug knows the carts of bern, and all carts are connected."""
    files = []
    for name in NAMES:
        files.append(str(tmp_path / f"{name}.yaml"))
        Path(files[-1]).write_text(CART.replace("NAME", name), "utf-8")
    made = await asyncio.to_thread(TwoSites, tmp_path, bern=files, zug=files)
    try:
        await asyncio.to_thread(made.start)
        async with AsyncExitStack() as stack:
            for site in (made.bern, made.zug):
                for name in NAMES:
                    cart = await stack.enter_async_context(site.open(name))
                    await cart.wait_for("speed", timeout=WAIT_S)
            await listed(made.zug, 4)
            yield made
    finally:
        await asyncio.to_thread(made.kill)


async def listed(site: Site, count: int) -> None:
    """Wait until a site lists a number of robots."""
    end_s = time.monotonic() + WAIT_S
    while len((await asyncio.to_thread(site.ask, "/api/v1/robots"))[1]["robots"]) < count:
        assert time.monotonic() < end_s
        await asyncio.sleep(0.2)


async def stop(site: Site) -> tuple[dict[str, str], dict[str, Any], float]:
    """Press STOP ALL; return the result of each robot, the whole reply and its time in seconds."""
    began_s = time.monotonic()
    status, said = await asyncio.to_thread(site.ask, "/api/v1/stop", {"all": True})
    took_s = time.monotonic() - began_s
    assert status == 200, said
    return {one["name"]: one["result"] for one in said["robots"]}, said, took_s


def latched(site: Site) -> set[str]:
    """Return the own robots of a site whose STOP is latched and confirmed."""
    robots = site.ask("/api/v1/robots")[1]["robots"]
    own = [one for one in robots if "@" not in one["name"]]
    return {one["name"] for one in own if one["latched"] and one["confirmed"]}


async def stop_ids(site: Site, robots: set[str]) -> set[str]:
    """Return the identifiers of the STOPs of robots in the audit log of a site."""
    async with asyncio.timeout(WAIT_S):
        while True:  # the log is written in the background
            rows = [one.entry for one in search(site.data / "audit.sqlite", AuditQuery())]
            found = [one for one in rows if one.what == "STOP" and one.robot in robots]
            if {one.robot for one in found} == robots:
                return {json.loads(one.arguments)["stop"] for one in found}
            await asyncio.sleep(0.1)


async def test_all_robots_of_both_sites_stop(sites: TwoSites) -> None:
    """Both audit logs have one identifier."""
    found, said, took_s = await stop(sites.zug)
    assert set(found.values()) == {"confirmed"}, said
    assert len(found) == 4
    assert took_s < LONGEST_S
    for site in (sites.bern, sites.zug):
        assert latched(site) == set(NAMES)
    assert await stop_ids(sites.bern, set(NAMES)) == {said["id"]}
    assert await stop_ids(sites.zug, {*NAMES, *(f"{one}@bern" for one in NAMES)}) == {said["id"]}


async def test_a_frozen_site_delays_no_other_and_is_stopped_when_it_continues(
    sites: TwoSites,
) -> None:
    """Its robots have no link within 1 s; the repeated STOP reaches them."""
    sites.bern.signal(signal.SIGSTOP)
    try:
        found, said, took_s = await stop(sites.zug)
        assert latched(sites.zug) == set(NAMES)
    finally:
        sites.bern.signal(signal.SIGCONT)
    assert took_s < LONGEST_S
    assert {name for name, one in found.items() if one == "no-link"} == {
        f"{one}@bern" for one in NAMES
    }
    assert {name for name, one in found.items() if one == "confirmed"} == set(NAMES), said
    end_s = time.monotonic() + WAIT_S
    while await asyncio.to_thread(latched, sites.bern) != set(NAMES):
        assert time.monotonic() < end_s
        await asyncio.sleep(0.1)
    assert await stop_ids(sites.bern, set(NAMES)) == {said["id"]}


async def test_the_command_line_stops_all_robots_of_a_running_server(sites: TwoSites) -> None:
    data = ("--data-dir", str(sites.zug.data))
    done = await asyncio.to_thread(run, "stop", "--all", *data)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "cart-1: stopped",
        "cart-1@bern: stopped",
        "cart-2: stopped",
        "cart-2@bern: stopped",
        "4 of 4 stopped",
    ]
    done = await asyncio.to_thread(run, "stop", "cart-1", "nobody", *data)
    assert done.returncode == 1
    assert done.stderr == "urc stop: 1 of 2 stopped; not nobody\n"
    done = await asyncio.to_thread(run, "stop", "--tag", "boats", *data)
    assert (done.returncode, done.stderr) == (1, "urc stop: no robot has the tag boats\n")
