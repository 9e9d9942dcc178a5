"""A dashboard with people of its own, in the test's loop."""

import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from pathlib import Path

from playwright.async_api import Page

from tests.e2e.dashboards import running_dashboard
from urc.access.control import AccessControl
from urc.access.directory import Principal
from urc.access.grants import parse_grant
from urc.access.passphrases import hash_of
from urc.access.store import AccessStore
from urc.testing.dashboard import FakeRobot
from urc.web.serve.access import Access

__all__ = ["PASSPHRASE", "PeopleServer", "is_refusal", "people_server"]

PASSPHRASE = "correct horse battery"  # noqa: S105 - of a test


class PeopleServer:
    """The address of the dashboard, and its people."""

    def __init__(self, address: str, store: AccessStore, access: Access) -> None:
        self.address = address
        self.store = store
        self.access = access

    async def add(self, name: str, *grants: str, passphrase: str = "") -> Principal:
        """Add a person."""
        person = self.store.add(
            "person", name, [parse_grant(one) for one in grants], now=time.time()
        )
        if passphrase:
            self.store.set_passphrase(person.id, hash_of(passphrase))
        await self.access.control.reload()
        return person

    async def enter(self, page: Page, path: str = "") -> None:
        """Open a page with the printed address, as the local user."""
        await page.goto(self.access.address(self.address))
        await page.wait_for_url(self.address)
        if path:
            await page.goto(f"{self.address}{path}")


@asynccontextmanager
async def people_server(folder: Path, *robots: FakeRobot) -> AsyncIterator[PeopleServer]:
    """Serve the robots to people of a new store."""
    with closing(AccessStore(folder)) as store:
        access = Access(AccessControl(store))
        async with running_dashboard(*robots, access=access) as address:
            yield PeopleServer(address, store, access)


def is_refusal(text: str) -> bool:
    """Return whether a fault of a page is an expected refusal."""
    return any(status in text for status in ("401", "403", "422", "429"))
