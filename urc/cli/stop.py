"""`urc stop`: stop robots through their server, and print the result of each robot.

Without `--server`, the command uses all of this user's running servers. STOP needs no token.
"""

import argparse
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urc._environment import TOKEN
from urc.cli.error_report import Misuse
from urc.cli.server_robot import add_server
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.runtime.running_servers import RunningServer

EXAMPLE = "urc stop --tag carts"

TIMEOUT_S = 5.0
"""Longest wait for a server, in seconds; servers answer within 1 s."""
_PATH = "/api/v1/stop"
_WORDS = {"confirmed": "stopped", "latched": "latched", "no-link": "NO LINK", "refused": "refused"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: the robots and the server."""
    parser.add_argument("robots", metavar="NAME", nargs="*", help="name of a robot on the server")
    parser.add_argument(
        "--tag", dest="tags", metavar="TAG", action="append", default=[],
        help="stop all robots with this tag; a site is a tag too (repeatable)",
    )  # fmt: skip
    parser.add_argument("--all", action="store_true", help="stop all robots of all sites")
    add_server(parser, "a server, such as https://robots.lab:8080 (default: the running servers)")
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Stop the robots and print the results; return 1 unless all robots are stopped."""
    if not (arguments.robots or arguments.tags or arguments.all):
        raise Misuse("name a robot, or use --tag TAG or --all")
    asked = {
        "robots": arguments.robots,
        "tags": [tag.removeprefix("#") for tag in arguments.tags],
        "all": arguments.all,
    }
    answers, faults = _answers(arguments, asked)
    results = _merged(answers)
    for name, one in sorted(results.items()):
        reason = f": {one['reason']}" if one["reason"] else ""
        print(printable(f"{name}: {_WORDS.get(one['result'], one['result'])}{reason}"))
    unknown = set(asked["tags"]).intersection(*(one["unknown_tags"] for one in answers))
    if unknown:
        raise UrcError(f"no robot has the tag {', '.join(sorted(unknown))}")
    moving = [name for name, one in results.items() if one["result"] in ("no-link", "refused")]
    if moving:
        count = len(results)
        raise UrcError(f"{count - len(moving)} of {count} stopped; not {', '.join(sorted(moving))}")
    print(f"{len(results)} of {len(results)} stopped")
    if faults:
        raise UrcError("; ".join(faults))
    return 0


def _answers(
    arguments: argparse.Namespace, asked: Mapping[str, Any]
) -> tuple[list[Mapping[str, Any]], list[str]]:
    """Send the request to the given server, or to all running servers of this user.

    Returns:
        The answers, and the reasons of servers without an answer; no answer at all is an error.
    """
    from urc.cli.server_robot import refuse_local_options

    refuse_local_options(arguments, ["--data-dir"])
    if arguments.server is not None:
        import asyncio

        return [asyncio.run(_ask_server(arguments, asked))], []
    from urc._folders import data_folder
    from urc.runtime.running_servers import servers

    found = servers(arguments.data or data_folder())
    if not found:
        raise UrcError("no server of this user runs on this computer; name one with --server URL")
    answers: list[Mapping[str, Any]] = []
    faults: list[str] = []
    for server in found.values():
        try:
            answers.append(_ask_running(server, asked))
        except UrcError as fault:
            faults.append(str(fault))
    if not answers:
        raise UrcError("; ".join(faults))
    return answers, faults


async def _ask_server(arguments: argparse.Namespace, asked: Mapping[str, Any]) -> Mapping[str, Any]:
    from urc.client.address import read_token, server_address, trust
    from urc.client.server_request import post

    token = "" if arguments.token_file else os.environ.get(TOKEN, "").strip()
    server = server_address(arguments.server, allow_unencrypted=arguments.allow_unencrypted)
    context = trust(arguments.authority) if server.scheme == "https" else None
    return await post(
        server, server.stop_several, asked, "STOP",
        token=read_token(token, arguments.token_file), context=context,
    )  # fmt: skip


def _ask_running(server: "RunningServer", asked: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the answer of a server on this computer; raise `UrcError` without an answer."""
    import json
    from http.client import HTTPException

    from urc.runtime.running_servers import headers, open_connection

    try:
        line = open_connection(server, TIMEOUT_S)
        sent = {**headers(server), "content-type": "application/json"}
        line.request("POST", _PATH, json.dumps(asked), sent)
        answer = line.getresponse()
        said = json.loads(answer.read())
        line.close()
    except (OSError, HTTPException, ValueError) as error:
        raise UrcError(f"STOP could not be delivered to {server.address}: {error}") from error
    if answer.status == 404 and said.get("code") == "unknown-tag":
        return {"robots": [], "unknown_tags": asked["tags"]}
    if answer.status != 200:
        raise UrcError(str(said.get("message", f"the server answered {answer.status}")))
    found: Mapping[str, Any] = said
    return found


def _merged(answers: Iterable[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Return the result of each robot; a server without the robot does not count."""
    results: dict[str, Mapping[str, Any]] = {}
    for answer in answers:
        for one in answer["robots"]:
            known = results.get(one["name"])
            if known is None or known["result"] == "refused":
                results[one["name"]] = one
    return results
