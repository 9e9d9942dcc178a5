"""Sites of a fleet: real servers that share nothing but the network.

Each site has a data folder of its own. The first site keeps the authority and listens, so it is the
router of the others. Its guests join with a code of an invitation.
"""

import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from bench.rig.programs import ROOT, Server

__all__ = ["FleetSite", "found_fleet"]

COMMAND_S = 120.0
"""Longest run time of a command, in seconds."""


class FleetSite:
    """A site: its data folder, its robots' documents, and its server while it runs."""

    def __init__(
        self,
        name: str,
        folder: Path,
        documents: Sequence[str],
        *options: str,
        inside: Sequence[str] = (),
    ) -> None:
        """Write the documents; start nothing.

        Args:
            name: the site's name.
            folder: empty folder for the documents and the server's data.
            documents: texts of the robots' documents.
            options: additional options for ``urc serve``.
            inside: command prefix for a network namespace, from `Relay.inside`.
        """
        self.name = name
        self.data = folder / "data"
        self.inside = tuple(inside)
        self._options = options
        self._programs = ExitStack()
        self._server: Server | None = None
        self.data.mkdir(parents=True)
        self._files = [folder / f"robot-{index}.yaml" for index in range(len(documents))]
        for file, text in zip(self._files, documents, strict=True):
            file.write_text(text, "utf-8")

    @property
    def server(self) -> Server:
        """The server of this site; raise `ValueError` before `start`."""
        if self._server is None:
            raise ValueError(f"the site {self.name} has not started")
        return self._server

    def start(self) -> Server:
        """Start the server, and wait until it listens; an earlier one is closed first."""
        self._programs.close()
        self._server = Server(self._files, self.data, "--fleet", *self._options, inside=self.inside)
        self._programs.callback(self._server.close)
        return self._server

    def close(self) -> None:
        """End the server."""
        self._programs.close()

    def command(self, *words: str) -> str:
        """Return the output of a ``urc`` command with this site's data folder."""
        command = [sys.executable, "-m", "urc.cli.main", *words, "--data-dir", str(self.data)]
        done = subprocess.run(
            [*self.inside, *command], cwd=ROOT, capture_output=True, text=True, timeout=COMMAND_S
        )
        if done.returncode:
            raise AssertionError(f"urc {' '.join(words[:2])}: {done.stderr.strip()}")
        return done.stdout.strip()


def found_fleet(router: FleetSite, guests: Sequence[FleetSite], address: str) -> None:
    """Make a fleet; `address` is the host and port at which the guests reach the router."""
    router.command("fleet", "init", "rig", "--site", router.name, "--listen", address)
    for guest in guests:
        code = router.command("fleet", "invite", guest.name, "--address", address)
        guest.command("fleet", "join", code)
