"""Sites on a fake network, each with a whole server, and the requests of a visitor."""

import asyncio
import json
import ssl
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import urllib3
from websockets.asyncio.client import ClientConnection, connect

from tests.e2e.transports.certificates import Authority, Pair
from urc import __version__
from urc.access.control import AccessControl
from urc.access.store import AccessStore
from urc.fleet.rules_file import RULES_FILE
from urc.testing.dashboard import FakeRobot
from urc.testing.fleet_bus import FakeFleetNetwork
from urc.web.app import DashboardOptions, Robot, build_app, serve
from urc.web.serve.access import Access
from urc.web.serve.site_peer import SitePeer, site_of
from urc.web.sites.site_network import SiteNetwork

__all__ = ["Keys", "Place", "keys_of", "message", "place", "write_rules"]

WAIT_S = 20.0


@dataclass(frozen=True)
class Keys:
    """The certificates of a site."""

    site: str
    folder: Path
    root: str
    pair: Pair

    def server_context(self) -> ssl.SSLContext:
        """Return mutual TLS for lines from other sites."""
        return self._context(ssl.PROTOCOL_TLS_SERVER)

    def client_context(self, site: str) -> ssl.SSLContext:
        """Return mutual TLS for lines to a site."""
        return self._context(ssl.PROTOCOL_TLS_CLIENT)

    def key_pem(self) -> bytes:
        """Return the private key."""
        return Path(self.pair.key).read_bytes()

    def peer(self, certificate_der: bytes) -> SitePeer:
        """Return the site of a certificate."""
        return site_of(certificate_der)

    def _context(self, kind: int) -> ssl.SSLContext:
        context = ssl.SSLContext(kind)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        context.load_verify_locations(self.root)
        context.load_cert_chain(self.pair.cert, self.pair.key)
        context.verify_mode = ssl.CERT_REQUIRED
        return context


def keys_of(authority: Authority, site: str, folder: Path, age_days: int = 0) -> Keys:
    """Return certificates for a site, in a new folder."""
    (folder / site).mkdir(parents=True, exist_ok=True)
    return Keys(site, folder / site, authority.file, authority.sign(site, age_days))


def write_rules(folder: Path, text: str) -> None:
    """Write a site's rules for visitors, without the first two keys."""
    content = f"urc: 1\nkind: site-rules\n{text}\n"
    (folder / RULES_FILE).write_text(content, encoding="utf-8")


class Place:
    """One running site, and requests to its dashboard."""

    def __init__(self, url: str, access: Access, network: SiteNetwork) -> None:
        self.url = url
        self.access = access
        self.network = network

    async def ask(
        self,
        path: str,
        body: object = None,
        *,
        key: str | None = None,
        more: Mapping[str, str] | None = None,
    ) -> tuple[int, Any, Mapping[str, str]]:
        """Return the status, the decoded body and the headers of a response."""
        word = self.access.key if key is None else key
        headers = {"authorization": f"Bearer {word}"} if word else {}
        headers.update(more or {})

        def send() -> urllib3.BaseHTTPResponse:
            data = None if body is None else json.dumps(body).encode()
            if data is not None:
                headers["content-type"] = "application/json"
            method = "GET" if body is None else "POST"
            return urllib3.request(
                method, self.url.rstrip("/") + path, body=data, headers=headers, timeout=WAIT_S,
                retries=False,
            )  # fmt: skip

        found = await asyncio.to_thread(send)
        kind = found.headers.get("content-type", "")
        text: Any = found.json() if "json" in kind else found.data
        return found.status, text, found.headers

    def socket(self, path: str) -> connect:
        """Return a socket of this dashboard, as a page has it."""
        headers = {"authorization": f"Bearer {self.access.key}"}
        return connect(
            self.url.replace("http", "ws").rstrip("/") + path, additional_headers=headers
        )


@asynccontextmanager
async def place(
    net: FakeFleetNetwork,
    keys: Keys,
    *robots: FakeRobot,
    rules: str = "",
    claims: str = "",
    version: str = __version__,
) -> AsyncIterator[Place]:
    """Run a site.

    Args:
        net: the network.
        keys: certificates of the site.
        robots: robots of the site.
        rules: rules for visitors, without the first two keys; "" for no file.
        claims: name of the site on the network; "" for the name in its certificate.
        version: version of URC that the site states.
    """
    if rules:
        write_rules(keys.folder, rules)
    store = AccessStore(keys.folder / "people")
    access = Access(AccessControl(store))
    network = SiteNetwork(keys, net.bus(claims or keys.site), version=version)
    app = build_app(
        {robot.profile.name: Robot(robot.profile, {}, robot.open) for robot in robots},
        DashboardOptions(access=access, linger_s=0.2, network=network),
    )
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result, door=network.door))
    try:
        async with asyncio.timeout(WAIT_S):
            await asyncio.wait((ready, task), return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        yield Place(await ready, access, network)
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)
        store.close()


async def message(line: ClientConnection, kind: str) -> dict[str, Any]:
    """Return the next text message of a kind."""
    async with asyncio.timeout(WAIT_S):
        while True:
            got = await line.recv()
            if isinstance(got, str):
                found: dict[str, Any] = json.loads(got)
                if found.get("t") == kind:
                    return found
