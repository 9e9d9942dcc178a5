"""`urc repo`: repositories of packages, those of others and one's own."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.arguments import add_host, is_loopback, port
from urc.cli.failures import Misuse
from urc.cli.output import complain
from urc.cli.repo_keys import key, token

if TYPE_CHECKING:
    from urc.packages.tokens import Tokens

EXAMPLE = "urc repo add http://192.168.1.5:8090/"

_PORT = 8090
_ARCHIVE_S = 60.0
"""In which a whole archive must come that somebody publishes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to do, and with what."""
    parser.add_argument(
        "action",
        metavar="ACTION",
        choices=tuple(_ACTIONS),
        help="add URL, remove URL, list, search WORD…, index DIR, serve DIR;"
        " token add|remove NAME, token list; key new NAME, key show, key list, key forget PACKAGE",
    )
    parser.add_argument(
        "words", metavar="URL|WORD|DIR|NAME", nargs="*", help="what it is done with"
    )
    parser.add_argument("--json", action="store_true", help="of search: one JSON line for each")
    parser.add_argument("--name", metavar="TEXT", help="of index and serve: what it is called")
    parser.add_argument(
        "--tokens",
        metavar="FILE",
        type=Path,
        help="of serve: who may publish; of token: the file that is changed",
    )
    parser.add_argument(
        "--may",
        metavar="PACKAGES",
        action="append",
        help="of token add: drivers/puppet, 'drivers/puppet*', 'widgets/*' or '*'; may be repeated",
    )
    parser.add_argument(
        "--key",
        metavar="FILE",
        type=Path,
        help="of index, serve and key: a publisher's key (default: your own, if any)",
    )
    add_host(parser)
    parser.add_argument(
        "--port", type=port, default=_PORT, help=f"of serve; 0 takes a free one (default: {_PORT})"
    )


def run(arguments: argparse.Namespace) -> int:
    """Do what was asked for."""
    return _ACTIONS[arguments.action](arguments)


def _one(arguments: argparse.Namespace, what: str) -> str:
    if len(arguments.words) != 1:
        raise Misuse(f"'urc repo {arguments.action}' takes one {what}")
    return str(arguments.words[0])


def _add(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import repositories
    from urc.problems import printable

    url, index = repositories().add(_one(arguments, "URL"))
    print(printable(f"added {url}: {index.name}, {len(index.packages)} versions of packages"))
    if url.startswith("http:"):
        complain(f"urc repo: {url} is not encrypted: who is in between can change what is listed")
    return 0


def _remove(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import repositories

    print(f"removed {repositories().remove(_one(arguments, 'URL'))}; what is installed stays")
    return 0


def _list(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import repositories

    if arguments.words:
        raise Misuse("'urc repo list' takes no more words")
    for repository in repositories().all():
        print(repository.name)
    return 0


def _search(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import search_repositories

    return search_repositories(arguments.words, is_json=arguments.json)


def _index(arguments: argparse.Namespace) -> int:
    """List what is in a folder, for any static web server; 1 when something is not listed."""
    from urc.cli.packages import signer
    from urc.packages.keeper import make_index
    from urc.runtime.examine import examine

    folder = Path(_one(arguments, "DIR"))
    listing = make_index(folder, _name(arguments, folder), examine, signer(arguments.key))
    for fault in listing.faults:
        complain(f"not listed: {fault}")
    print(f"{folder / 'index.json'}  {len(listing.listed.packages)} versions of packages")
    return 1 if listing.faults else 0


def _serve(arguments: argparse.Namespace) -> int:
    """List what is in a folder, and give it out until Ctrl-C or SIGTERM."""
    from urc.cli.running import run_loop
    from urc.packages.server import repository_app
    from urc.runtime.examine import examine_apart
    from urc.web.connection import REQUEST_S
    from urc.web.server import serve

    folder = Path(_one(arguments, "DIR"))
    tokens = _tokens(arguments, folder)
    _index(arguments)
    if not is_loopback(arguments.host):
        complain(f"urc repo: anyone on the network of {arguments.host} can read this repository")

    async def work() -> int:
        await serve(
            repository_app(folder, tokens, examine_apart),
            host=arguments.host,
            port=arguments.port,
            on_ready=_print_url,
            request_s=_ARCHIVE_S if tokens else REQUEST_S,
        )
        return 0

    return run_loop(work(), code_when_ended=0)


def _tokens(arguments: argparse.Namespace, folder: Path) -> "Tokens | None":
    """Return who may publish, or None: nobody."""
    from urc.packages.tokens import Tokens

    file: Path | None = arguments.tokens
    if file is None:
        return None
    if file.resolve().is_relative_to(folder.resolve()):
        raise Misuse(
            f"{file}: it stands in the repository, which any web server gives out; move it"
        )
    Tokens(file).all()  # what is wrong with it is told now, not to the first who publishes
    return Tokens(file)


def _print_url(url: str) -> None:
    print(f"repository {url}", flush=True)


def _name(arguments: argparse.Namespace, folder: Path) -> str:
    name = str(arguments.name or folder.resolve().name or "repository")
    if len(name) > 200 or not name.isprintable():
        raise Misuse("--name is one line of at most 200 characters")
    return name


_ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "add": _add,
    "remove": _remove,
    "list": _list,
    "search": _search,
    "index": _index,
    "serve": _serve,
    "token": token,
    "key": key,
}
