"""The other sites of the fleet, as the running server with a data folder knows them."""

import argparse
import json
from http.client import HTTPException
from pathlib import Path
from threading import Event
from typing import Any, Final

from urc.cli.identities import show
from urc.runtime.running_servers import RunningServer, headers, open_connection, servers

__all__ = ["known_sites", "show_sites", "site_faults"]

_ANSWER_S: Final = 3.0
"""Time limit for each step of the request, in seconds."""
_NEWS_S: Final = 1.0
"""Wait for new lists of the sites, in seconds."""
_MOST_BYTES: Final = 1 << 24


def known_sites(data: Path) -> list[dict[str, Any]]:
    """Return the sites that a running server of this data folder knows; [] without a server."""
    for server in servers(data).values():
        try:
            found = _asked(server)
        except (OSError, ValueError, HTTPException):  # ended, or another program has its port
            continue
        if found:
            return found
    return []


def site_faults(data: Path) -> list[str]:
    """Return why the robots of present sites cannot be used here, one line for each site.

    A running server asks the sites for their lists because of the first look.
    """
    if not known_sites(data):
        return []
    Event().wait(_NEWS_S)
    return [one["fault"] for one in known_sites(data) if one.get("fault")]


def show_sites(sites: list[dict[str, Any]], arguments: argparse.Namespace) -> None:
    """Print the sites as a table."""
    table = [("OTHER SITE", "URC", "PRESENT", "PROBLEM")]
    for one in sites:
        present = "yes" if one["present"] else "no"
        table.append((one["name"], one["version"] or "-", present, one.get("fault") or "-"))
    show(sites, table, arguments, "")


def _asked(server: RunningServer) -> list[dict[str, Any]]:
    line = open_connection(server, _ANSWER_S)
    try:
        line.request("GET", "/api/v1/robots", headers=headers(server))
        reply = line.getresponse()
        if reply.status != 200:
            return []
        found = json.loads(reply.read(_MOST_BYTES)).get("sites", [])
    finally:
        line.close()
    return [one for one in found if isinstance(one, dict)]
