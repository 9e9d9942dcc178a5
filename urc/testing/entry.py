"""The way into a dashboard of a test: known keys, and what a browser sends that has handed one in.

For tests alone.
"""

from copy import copy

from urc.web.serve.access import Access

__all__ = ["ACCESS", "BEARER", "HERE", "HERE_COOKIE", "KEY", "MANAGER", "OPEN"]

KEY = "the-start-key-of-a-test"
TOKEN = "the-token-of-managers-in-a-test"  # noqa: S105 - it opens nothing else

ACCESS = Access(key=KEY, instance="test", token=TOKEN)
"""Of a dashboard for this machine alone."""
OPEN = copy(ACCESS)
"""Of one that others reach, too. Both know the same browsers."""
OPEN.is_open = True

HERE = {ACCESS.cookie: str(ACCESS.admit(KEY))}
"""Cookies of a browser that has the start key."""
HERE_COOKIE = f"{ACCESS.cookie}={HERE[ACCESS.cookie]}"
"""The header with it."""
MANAGER = {ACCESS.cookie: str(ACCESS.admit(TOKEN))}
"""Cookies of a browser that has the token of managers."""
BEARER = {"authorization": f"Bearer {KEY}"}
"""The header that a program sends."""
