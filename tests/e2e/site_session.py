"""One Zenoh session of a site, as a process of its own, with the files of its membership.

Run with the folder of the membership, the mode and an endpoint. The process prints ``open`` or the
reason of the failure. A router then runs until its standard input ends.
"""

import json
import sys
from pathlib import Path

import zenoh

from urc.fleet.membership import Membership


def settings(own: Membership, mode: str, endpoint: str) -> str:
    """Return Zenoh's configuration for mutual TLS."""
    tls = {
        "root_ca_certificate": str(own.root_file),
        "listen_certificate": str(own.certificate_file),
        "listen_private_key": str(own.key_file),
        "connect_certificate": str(own.certificate_file),
        "connect_private_key": str(own.key_file),
        "enable_mtls": True,
        "verify_name_on_connect": False,
    }
    place = "listen" if mode == "router" else "connect"
    return json.dumps(
        {
            "mode": mode,
            "connect": {"timeout_ms": 4000, "exit_on_failure": True},
            place: {"endpoints": [endpoint], "timeout_ms": 4000, "exit_on_failure": True},
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "transport": {"shared_memory": {"enabled": False}, "link": {"tls": tls}},
        }
    )


def main() -> None:
    """Open the session and say how it went."""
    folder, mode, endpoint = sys.argv[1:]
    config = zenoh.Config.from_json5(settings(Membership.load(Path(folder)), mode, endpoint))
    try:
        with zenoh.open(config):
            say("open")
            if mode == "router":
                sys.stdin.read()
    except zenoh.ZError as error:
        say(f"refused: {error}".splitlines()[0])


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
