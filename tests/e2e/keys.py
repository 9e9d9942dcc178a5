"""Keys of the dashboards that tests start: handed in by their pages and programs, as by people.

A process prints its address with a key. `UrcProcess` keeps the key here and tells tests the address
without it, so that they append their paths.
"""

import asyncio
import re
import time
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from weakref import WeakSet

from playwright.async_api import BrowserContext, Page

from tests.e2e.browser import PLAIN_HOST
from urc.access.grants import parse_grant
from urc.access.store import AccessStore
from urc.testing.entry import ACCESS, HERE

__all__ = [
    "enter",
    "entering",
    "headers_for",
    "known_here",
    "learn",
    "signed_in",
    "with_key",
    "without_key",
]

_PRINTED = re.compile(r"(dashboard )(https?://[^/\s]+)/\?key=(\S+)")
_NOTICED_S = 30
_keys: dict[str, str] = {}
"""Origin → key."""
_own_browsers: WeakSet[BrowserContext] = WeakSet()
"""Browsers that hand in no key by themselves."""


def learn(line: str) -> str:
    """Return a line of a dashboard without its key, which is kept."""
    found = _PRINTED.match(line)
    if found is None:
        return line
    _keys[found[2]] = found[3]
    return f"{found[1]}{found[2]}/{line[found.end() :]}"


def headers_for(address: str) -> dict[str, str]:
    """Return what a program sends to the dashboard of a process; nothing where no key is known."""
    key = _key_of(address)
    return {"Authorization": f"Bearer {key}"} if key else {}


async def enter(context: BrowserContext, address: str) -> None:
    """Hand in the key of the dashboard at `address`, if it is one of a process."""
    key = _key_of(address)
    if key:
        await context.request.get(f"{_origin(address)}/?key={key}")


def entering(page: Page) -> None:
    """Let a page hand in keys by itself, before it opens an address for the first time."""
    goto, entered = page.goto, set[str]()

    async def opened(url: str, **how: Any) -> Any:
        key = _key_of(url)
        if key not in entered and page.context not in _own_browsers:
            entered.add(key)
            await enter(page.context, url)
        return await goto(url, **how)

    setattr(page, "goto", opened)  # noqa: B010 - a method, for this page alone


def with_key(address: str) -> str:
    """Return the address of the dashboard of a process with its key, as the process printed it."""
    return f"{_origin(address)}/?key={_key_of(address)}"


def without_key(context: BrowserContext) -> None:
    """Let a browser hand in no start key by itself."""
    _own_browsers.add(context)


async def signed_in(
    context: BrowserContext, address: str, data: Path, name: str, *grants: str
) -> None:
    """Sign a new person in at the dashboard of a process with this data folder.

    The browser hands in no start key, because it is the person's own.
    """
    without_key(context)
    with closing(AccessStore(data)) as store:
        now = time.time()
        person = store.add("person", name, [parse_grant(one) for one in grants], now=now)
        _, secret = store.open_sign_in(person.id, "passphrase", now=now)
        cookie = f"urc-sign-in-{store.instance()}"
    url = _origin(address)
    await context.add_cookies([{"name": cookie, "value": secret, "url": url}])
    async with asyncio.timeout(_NOTICED_S):
        # Until the server, another process, has read the file.
        while not (await context.request.get(f"{url}/")).ok:  # noqa: ASYNC110
            await asyncio.sleep(0.02)


async def known_here(context: BrowserContext) -> None:
    """Let a browser be known to every dashboard that runs in the tests' own process."""
    hosts = ("127.0.0.1", "localhost", PLAIN_HOST)
    value = HERE[ACCESS.cookie]
    await context.add_cookies(
        [
            {
                "name": ACCESS.cookie, "value": value, "domain": host, "path": "/",
                "httpOnly": True, "sameSite": "Strict",
            }
            for host in hosts
        ]
    )  # fmt: skip


def _key_of(address: str) -> str:
    # A server that listens everywhere prints one of its addresses.
    port = urlsplit(address).port
    return next(
        (key for origin, key in reversed(_keys.items()) if urlsplit(origin).port == port), ""
    )


def _origin(address: str) -> str:
    parts = urlsplit(address)
    return f"{parts.scheme}://{parts.netloc}"
