"""Access control for the dashboards of tests, with known keys and cookies.

For tests only.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from urc.access.control import AccessControl
from urc.access.grants import parse_grant
from urc.access.store import AccessStore
from urc.web.serve.access import Access

__all__ = ["ACCESS", "BEARER", "HERE", "HERE_COOKIE", "KEY", "OPEN", "person"]

KEY = "the-start-key-of-a-test"

_FOLDER = TemporaryDirectory(prefix="urc-test-people-")  # removed when the process ends
STORE = AccessStore(Path(_FOLDER.name))
CONTROL = AccessControl(STORE, key=KEY)

ACCESS = Access(CONTROL, instance="test")
"""Access control of a dashboard that requires a sign-in."""
OPEN = Access(CONTROL, instance="test", anonymous="drive")
"""Access control of a dashboard that needs no sign-in; it also accepts the cookies of `ACCESS`."""

HERE = {ACCESS.cookie: str(ACCESS.admit(KEY))}
"""Cookies of a browser that has sent the start key."""
HERE_COOKIE = f"{ACCESS.cookie}={HERE[ACCESS.cookie]}"
"""Cookie header of a browser that has sent the start key."""
BEARER = {"authorization": f"Bearer {KEY}"}
"""Authorization header for requests from a program."""


def person(name: str, *grants: str) -> dict[str, str]:
    """Return the cookies of a new, signed-in person with these grants."""
    now = CONTROL.now()
    added = STORE.add("person", name, [parse_grant(one) for one in grants], now=now)
    _, secret = STORE.open_sign_in(added.id, "passphrase", now=now)
    CONTROL.load()
    return {ACCESS.sign_in_cookie: secret}
