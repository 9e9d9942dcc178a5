"""`urc repo`: repositories of packages, those of others and one's own."""

import argparse
from collections.abc import Callable
from pathlib import Path

from urc.cli.arguments import add_host, is_loopback, port
from urc.cli.failures import Misuse
from urc.cli.output import complain, json_text

EXAMPLE = "urc repo add http://192.168.1.5:8090/"

_PORT = 8090


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to do, and with what."""
    parser.add_argument(
        "action",
        metavar="ACTION",
        choices=tuple(_ACTIONS),
        help="add URL, remove URL, list, search WORD…, index DIR, or serve DIR",
    )
    parser.add_argument("words", metavar="URL|WORD|DIR", nargs="*", help="what it is done with")
    parser.add_argument("--json", action="store_true", help="of search: one JSON line for each")
    parser.add_argument("--name", metavar="TEXT", help="of index and serve: what it is called")
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
    from urc.cli.packages import repositories
    from urc.packages.index import search
    from urc.packages.sources import merged
    from urc.problems import printable

    known = repositories().all()
    if not known:
        raise Misuse("no repository is known; 'urc repo add URL' adds one")
    found = merged(known, complain)
    entries = [entry for some in found.values() for entry, _ in some]
    hits = search(entries, arguments.words)
    for entry in hits:
        if arguments.json:
            said = {"package": str(entry.key), "version": entry.version, "summary": entry.summary}
            print(json_text(said))
        else:
            print(printable(f"{entry}  {entry.summary}".rstrip()))
    return 0 if hits else 1


def _index(arguments: argparse.Namespace) -> int:
    """List what is in a folder, for any static web server; 1 when something is not listed."""
    from urc.packages.keeper import make_index

    folder = Path(_one(arguments, "DIR"))
    listing = make_index(folder, _name(arguments, folder), _examine)
    for fault in listing.faults:
        complain(f"not listed: {fault}")
    print(f"{folder / 'index.json'}  {len(listing.listed.packages)} versions of packages")
    return 1 if listing.faults else 0


def _serve(arguments: argparse.Namespace) -> int:
    """List what is in a folder, and give it out until Ctrl-C or SIGTERM."""
    from urc.cli.running import run_loop
    from urc.packages.server import repository_app
    from urc.web.server import serve

    _index(arguments)
    folder = Path(_one(arguments, "DIR"))
    if not is_loopback(arguments.host):
        complain(f"urc repo: anyone on the network of {arguments.host} can read this repository")

    async def work() -> int:
        await serve(
            repository_app(folder), host=arguments.host, port=arguments.port, on_ready=_print_url
        )
        return 0

    return run_loop(work(), code_when_ended=0)


def _print_url(url: str) -> None:
    print(f"repository {url}", flush=True)


def _name(arguments: argparse.Namespace, folder: Path) -> str:
    name = str(arguments.name or folder.resolve().name or "repository")
    if len(name) > 200 or not name.isprintable():
        raise Misuse("--name is one line of at most 200 characters")
    return name


def _examine(document: Path) -> list[str]:
    """Return the errors of a package's document in a repository's folder, its tests included."""
    from urc.config.load import check
    from urc.runtime.catalog import built_in_catalog
    from urc.runtime.selftest import exercise
    from urc.runtime.shelves import TwoShelves
    from urc.shipped import shipped

    top = document.parent.parent.parent
    checked = check(document, built_in_catalog(), TwoShelves(shipped("widgets"), top / "widgets"))
    homes = (top.resolve(), shipped("widgets").resolve())
    outside = [
        f"{document}: it refers to {file}, which is not in this repository"
        for file in checked.files
        if not any(Path(file).resolve().is_relative_to(home) for home in homes)
    ]
    if outside:
        return outside
    problems = [*checked.problems]
    if checked.profile is not None:
        problems += exercise(checked.profile).problems
    return [problem.headline for problem in problems if problem.severity == "error"]


_ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "add": _add,
    "remove": _remove,
    "list": _list,
    "search": _search,
    "index": _index,
    "serve": _serve,
}
