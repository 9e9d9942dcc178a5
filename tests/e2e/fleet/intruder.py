"""A program in a fleet's network that does what no site does: for tests of what is refused."""

import json
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any, Final

from tests.e2e.dashboards import until
from urc._x509 import key_pem
from urc.fleet.assertion import SCHEME, Assertion, sign_assertion
from urc.fleet.lines import Lines
from urc.fleet.membership import Membership
from urc.fleet.zenoh_bus import BusOptions, ZenohBus
from urc.web.serve.site_peer import site_of
from urc.web.sites.site_client import SiteClient, SiteFailed

__all__ = ["Intruder"]

_ANN: Final = Assertion("p1", "Ann", "person", "s1", "cart", "drive")
_JSON: Final = (b"content-type", b"application/json")


class Intruder:
    """Sends requests to one site."""

    def __init__(self, client: SiteClient, member: Membership, site: str) -> None:
        self._client = client
        self._member = member
        self._site = site

    @classmethod
    @asynccontextmanager
    async def inside(
        cls,
        member: Membership,
        *,
        claims: str = "",
        router: Membership | None = None,
        site: str = "bern",
    ) -> AsyncIterator["Intruder"]:
        """Join the network.

        Args:
            member: certificate for the lines to the site.
            claims: name on the network; "" for the name in the certificate.
            router: certificate by which the network admits this program; None for `member`.
            site: the site that gets the requests.
        """
        hop = router or member
        options = BusOptions(
            hop.fleet, claims or member.site, (), hop.connect, hop.root_file,
            hop.certificate_file, hop.key_file,
        )  # fmt: skip
        bus = ZenohBus(options)
        lines = Lines(bus)
        await bus.open()
        try:
            yield cls(SiteClient(lines, lambda _: _trusting(member), site_of), member, site)
        finally:
            lines.close()
            await bus.close()

    async def sees_site(self) -> None:
        """Wait until the site is present."""
        await until(lambda: self._site in self._client.sites)

    def assertion(self, now: float, **changes: str) -> str:
        """Return an assertion for the site's cart, signed by this program.

        Args:
            now: UTC time of the signature, in seconds since 1970.
            changes: other values for `issuer`, `audience`, or fields of `Assertion`.
        """
        issuer = changes.pop("issuer", self._member.site)
        audience = changes.pop("audience", self._site)
        key = key_pem(self._member.key)
        content = replace(_ANN, **changes)  # type: ignore[arg-type]
        return sign_assertion(content, issuer=issuer, audience=audience, key_pem=key, now=now)

    async def ask(
        self, path: str, assertion: str, body: object = None
    ) -> tuple[int, dict[str, Any]]:
        """Return the status and the decoded body of a response; 0 and a message without one."""
        proof = (b"authorization", f"{SCHEME} {assertion}".encode())
        data = json.dumps(body or {}).encode()
        try:
            asking = self._client.request(
                self._site, "POST", path, (proof, _JSON), data, lane="control"
            )
            async with asking as response:
                return response.status, json.loads(await response.whole())
        except SiteFailed as fault:
            return 0, {"message": str(fault)}


def _trusting(member: Membership) -> ssl.SSLContext:
    """Return a context that shows a certificate, and trusts every other one."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    context.load_cert_chain(member.certificate_file, member.key_file)
    return context
