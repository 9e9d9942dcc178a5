"""Access to the dashboard of a test, with known keys and the cookies of admitted browsers.

For tests alone.
"""

from copy import copy

from urc.web.serve.access import Access

__all__ = ["ACCESS", "BEARER", "HERE", "HERE_COOKIE", "KEY", "MANAGER", "OPEN"]

KEY = "the-start-key-of-a-test"
TOKEN = "the-token-of-managers-in-a-test"  # noqa: S105 - valid only in tests

ACCESS = Access(key=KEY, instance="test", token=TOKEN)
"""Access to a dashboard that only this machine can reach."""
OPEN = copy(ACCESS)
"""Access to a dashboard that other machines can reach too, with the same admitted browsers."""
OPEN.is_open = True

HERE = {ACCESS.cookie: str(ACCESS.admit(KEY))}
"""Cookies of a browser that has sent the start key."""
HERE_COOKIE = f"{ACCESS.cookie}={HERE[ACCESS.cookie]}"
"""Cookie header of a browser that has sent the start key."""
MANAGER = {ACCESS.cookie: str(ACCESS.admit(TOKEN))}
"""Cookies of a browser that has sent the token of managers."""
BEARER = {"authorization": f"Bearer {KEY}"}
"""Authorization header for requests from a program."""
