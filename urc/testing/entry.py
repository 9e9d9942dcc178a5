"""Access to the dashboard of a test: known keys, and the cookies of an admitted browser.

For tests alone.
"""

from copy import copy

from urc.web.serve.access import Access

__all__ = ["ACCESS", "BEARER", "HERE", "HERE_COOKIE", "KEY", "MANAGER", "OPEN"]

KEY = "the-start-key-of-a-test"
TOKEN = "the-token-of-managers-in-a-test"  # noqa: S105 - valid only in tests

ACCESS = Access(key=KEY, instance="test", token=TOKEN)
"""Access to a dashboard on this machine only."""
OPEN = copy(ACCESS)
"""Access to a dashboard that other machines can reach, with the same browsers."""
OPEN.is_open = True

HERE = {ACCESS.cookie: str(ACCESS.admit(KEY))}
"""Cookies of a browser with the start key."""
HERE_COOKIE = f"{ACCESS.cookie}={HERE[ACCESS.cookie]}"
"""Header with these cookies."""
MANAGER = {ACCESS.cookie: str(ACCESS.admit(TOKEN))}
"""Cookies of a browser with the token of managers."""
BEARER = {"authorization": f"Bearer {KEY}"}
"""Header for requests from a program."""
