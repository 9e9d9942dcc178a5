"""The certificates of sites on real connections: asyncio, uvloop, and Zenoh's own TLS in Rust."""

import asyncio
import ssl
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import uvloop

from tests.e2e.command_line import TIMEOUT_S
from tests.e2e.ports import free_port
from tests.e2e.processes import ROOT
from tests.unit.fleet.fleets import Place
from urc.fleet.certificates import SITE_LASTS
from urc.fleet.joining import renew_own
from urc.fleet.membership import Membership

NOW = datetime.now(UTC)


async def name_seen(server: Membership, client: Membership, wanted: str) -> str:
    """Return the name of the client's site as the server has read it, over a real connection."""
    names: asyncio.Queue[str] = asyncio.Queue()

    async def greet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        shown = writer.get_extra_info("ssl_object").getpeercert(binary_form=True)
        names.put_nowait(server.peer(shown, NOW).site)
        writer.close()

    listening = await asyncio.start_server(greet, "127.0.0.1", 0, ssl=server.server_context())
    async with listening:
        address = listening.sockets[0].getsockname()[:2]
        _, writer = await asyncio.open_connection(*address, ssl=client.client_context(wanted))
        try:
            return await asyncio.wait_for(names.get(), TIMEOUT_S)
        finally:
            writer.close()


@pytest.mark.parametrize("start", [asyncio.run, uvloop.run])
def test_two_sites_prove_their_names_over_a_socket(
    tmp_path: Path, start: Callable[[Any], str]
) -> None:
    """The address of the server is no name in its certificate; the site's name is."""
    place = Place(tmp_path, now=NOW)
    hall = place.member(now=NOW)
    assert start(name_seen(place.office, hall, "office")) == "hall"
    with pytest.raises(ssl.SSLCertVerificationError, match="not valid for 'store'"):
        start(name_seen(place.office, hall, "store"))


@contextmanager
def router(site: Membership) -> Iterator[str]:
    """Run a router with the site's files; yield its endpoint."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.e2e.site_session", str(site.folder), "router", endpoint],
        cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    with process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "open\n"
            yield endpoint
        finally:
            process.kill()


def session(site: Membership, endpoint: str) -> str:
    """Return what a client with the site's files says about its connection."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.e2e.site_session", str(site.folder), "client", endpoint],
        cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S, check=True,
    )  # fmt: skip
    return done.stdout.strip()


def test_zenoh_connects_sites_of_one_fleet_and_no_others(tmp_path: Path) -> None:
    """A stranger has the same names; a late site had the right certificate until yesterday."""
    past = NOW - SITE_LASTS - timedelta(days=1)
    place, other = Place(tmp_path / "a", now=past), Place(tmp_path / "b", now=NOW)
    late = place.member("late", now=past)
    hall, stranger = place.member(now=NOW), other.member(now=NOW)
    with router(renew_own(place.authority, place.office, NOW)) as endpoint:
        assert session(hall, endpoint) == "open"
        for site in (stranger, late):
            assert session(site, endpoint).startswith("refused: ")
        assert session(hall, endpoint) == "open"
