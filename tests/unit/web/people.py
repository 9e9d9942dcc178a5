"""A server with people, its browsers, and what they send."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

from urc.access.control import AccessControl
from urc.access.grants import parse_grant
from urc.access.passphrases import hash_of
from urc.access.store import AccessStore
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.robots import Robot
from urc.web.serve.access import Access

__all__ = ["ADDRESS", "OURS", "PASSPHRASE", "Door", "post"]

ADDRESS = "http://localhost:8080"
OURS = {"origin": ADDRESS}
PASSPHRASE = "correct horse battery"  # noqa: S105 - of a test


class Door:
    """A server with people, and its browsers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.store = AccessStore(folder)
        self.access = Access(AccessControl(self.store))
        robot = FakeRobot(dashboard_profile())
        self.app = build_app(
            {"puppet": Robot(robot.profile, {}, robot.open)},
            DashboardOptions(access=self.access, data=folder),
        )

    def add(self, name: str, *grants: str, passphrase: str = "") -> str:
        """Add a person, with a passphrase if one is given; return its id."""
        person = self.store.add(
            "person", name, [parse_grant(one) for one in grants], now=time.time()
        )
        if passphrase:
            self.store.set_passphrase(person.id, hash_of(passphrase))
        self.access.control.load()
        return person.id

    def signed_in(self, name: str, *grants: str) -> dict[str, str]:
        """Return the cookies of a new person who has signed in."""
        person = self.add(name, *grants)
        _, secret = self.store.open_sign_in(person, "passphrase", now=time.time())
        self.access.control.load()
        return {self.access.sign_in_cookie: secret}

    def close(self) -> None:
        """Close the file of the people."""
        self.store.close()

    @contextmanager
    def browser(
        self, host: str = "192.0.2.7", cookies: Mapping[str, str] | None = None
    ) -> Iterator[TestClient]:
        """Give the first browser in front of the server, which runs meanwhile."""
        with TestClient(
            self.app, base_url=ADDRESS, client=(host, 50_000), cookies=dict(cookies or {})
        ) as browser:
            browser.app_state["flow"] = SocketFlow()
            yield browser

    def other(
        self, first: TestClient, host: str = "192.0.2.8", cookies: Mapping[str, str] | None = None
    ) -> TestClient:
        """Return one more browser, while `first` is open."""
        found = TestClient(
            self.app, base_url=ADDRESS, client=(host, 50_001), cookies=dict(cookies or {})
        )
        found.portal = first.portal
        return found


def post(browser: TestClient, path: str, **said: Any) -> Any:
    """Send a request of a page; return the status and the JSON response."""
    answer = browser.post(f"/api/v1/{path}", json=said, headers=OURS)
    return answer.status_code, answer.json()
