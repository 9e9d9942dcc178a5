"""Which modules stay in one process, where a run has several.

Some share something of the machine: an account, a pair of terminals. Others begin with something
that takes long, and is made once for all their tests.
"""

from pathlib import PurePosixPath

from xdist.scheduler import LoadScopeScheduling

__all__ = ["TOGETHER", "Together"]

TOGETHER = {
    "test_ssh": "shell",
    "test_ssh_login": "shell",
    "test_chain": "shell",
    "test_trust": "shell",
    "test_shell_servers": "shell",
    "test_serial": "serial",
    "test_hostile_serial": "serial",
    "test_manager_pages": "manager pages",
    "test_editor": "editor",
    "test_wheel": "wheel",
    "test_other_browsers": "other browsers",
    "test_site": "site",
    "test_playground": "playground",
}
"""Module → the group that it is in. Not by the marks of ``pytest-xdist``, which adds its groups to
the names of tests in a way that pytest 9.2 does not see: then all are scattered, without a word."""


class Together(LoadScopeScheduling):
    """Gives whole groups to one process, the largest first, and every other test to any."""

    def _split_scope(self, nodeid: str) -> str:
        """Return what must stay together with a test."""
        return TOGETHER.get(PurePosixPath(nodeid.partition("::")[0]).stem, nodeid)
