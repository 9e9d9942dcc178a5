"""`urc repo`: use and maintain package repositories."""

import argparse
import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli import repo_blocks
from urc.cli.arguments import add_host, is_loopback, port
from urc.cli.audited import audit_packages
from urc.cli.error_report import Misuse
from urc.cli.output import complain
from urc.cli.repo_keys import key, unsigned

if TYPE_CHECKING:
    from urc.packages.index_head import IndexSigner
    from urc.packages.tokens import UploadTokens


def token(arguments: argparse.Namespace) -> int:
    """Add, list or remove the upload tokens of a repository."""
    from urc.packages.tokens import UploadTokens
    from urc.problems import printable

    if arguments.tokens is None:
        raise Misuse(
            "'urc repo token' requires --tokens FILE, the same file as for 'urc repo serve'"
        )
    tokens = UploadTokens(arguments.tokens)
    match arguments.words:
        case ["add", name]:
            if not arguments.may:
                raise Misuse(
                    "'urc repo token add' requires --may with the packages"
                    " that the token may publish"
                )
            print(tokens.add(name, tuple(arguments.may)))
        case ["remove", name]:
            tokens.remove(name)
            print(f"removed {name}: this token can no longer publish")
        case ["list"]:
            for one in tokens.all():
                print(printable(f"{one.name}  {', '.join(one.may)}"))
        case _:
            raise Misuse("expected 'urc repo token' with add NAME, remove NAME or list")
    return 0


EXAMPLE = "urc repo add http://192.168.1.5:8090/"

_PORT = 8090
_ARCHIVE_S = 60.0
"""Timeout for uploading an archive, in seconds."""
_RENEW_S = 3600.0
"""Interval at which a served index is checked for expiry, in seconds."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: action and options."""
    parser.add_argument(
        "action",
        metavar="ACTION",
        choices=tuple(_ACTIONS),
        help="add URL, remove URL, list, search WORD…, index DIR, serve DIR,"
        " withdraw DIR PACKAGE VERSION, restore DIR PACKAGE VERSION;"
        " token add|remove NAME, token list; key new NAME, key show, key list, key forget PACKAGE;"
        " unsigned add|remove PACKAGE, unsigned list;"
        " block DIR PACKAGE [RANGE], unblock DIR PACKAGE [RANGE];"
        " blocks list, blocks import FILE, blocks export DIR FILE, blocks forget KEY",
    )
    parser.add_argument(
        "words", metavar="URL|WORD|DIR|NAME", nargs="*", help="arguments of the action"
    )
    parser.add_argument(
        "--json", action="store_true", help="search: print one JSON line per package"
    )
    _add_publisher_arguments(parser)
    add_host(parser)
    parser.add_argument(
        "--port",
        type=port,
        default=_PORT,
        help=f"serve: port; 0 selects a free port (default: {_PORT})",
    )


def _add_publisher_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options for publishing packages: keys, upload tokens and reasons."""
    parser.add_argument("--name", metavar="TEXT", help="index, serve: title of the repository")
    parser.add_argument(
        "--tokens",
        metavar="FILE",
        type=Path,
        help="serve: file with the upload tokens; token: token file to change",
    )
    parser.add_argument(
        "--may",
        metavar="PACKAGES",
        action="append",
        help="token add: drivers/puppet, 'drivers/puppet*', 'widgets/*' or '*'; repeatable",
    )
    parser.add_argument(
        "--key",
        metavar="FILE",
        type=Path,
        help="index, serve, withdraw, restore, block, unblock, blocks, key: file of the"
        " publisher's key (default: your own key, if you have one)",
    )
    parser.add_argument(
        "--valid",
        metavar="DAYS",
        type=_days,
        default=14,
        help="index, serve, withdraw, restore, block, unblock: validity of a signed index in"
        " days, 1 to 365 (default: 14)",
    )
    parser.add_argument(
        "--why",
        metavar="TEXT",
        help="withdraw, block: reason shown to users of the version or package",
    )
    parser.add_argument(
        "--signed-by",
        metavar="SHA256:…",
        help="blocks import: trust the key with this fingerprint",
    )


def _days(text: str) -> int:
    """Return a number of days from 1 to 365; raise an argparse error for other text."""
    if text.isdecimal() and len(text) < 4 and 1 <= int(text) <= 365:
        return int(text)
    raise argparse.ArgumentTypeError(f"expected 1 to 365 days, found {text[:20]!r}")


def run(arguments: argparse.Namespace) -> int:
    """Run the action."""
    return _ACTIONS[arguments.action](arguments)


def _one(arguments: argparse.Namespace, what: str) -> str:
    if len(arguments.words) != 1:
        raise Misuse(f"'urc repo {arguments.action}' requires exactly one {what}")
    return str(arguments.words[0])


def _add(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import repositories
    from urc.problems import printable

    known = repositories()
    url, index = known.add(_one(arguments, "URL"))
    audit_packages("repository add", [url])
    print(printable(f"added {url}: {index.name}, {len(index.packages)} package versions"))
    keeper = next((one.keeper for one in known.all() if one.name == url), "")
    print(printable(f"its index is signed by {keeper}" if keeper else "its index is not signed"))
    if url.startswith("http:"):
        complain(
            f"urc repo: {url} is not encrypted: an attacker on the network can change the index"
        )
    return 0


def _remove(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import repositories

    url = repositories().remove(_one(arguments, "URL"))
    audit_packages("repository remove", [url])
    print(f"removed {url}; its installed packages remain installed")
    return 0


def _list(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import repositories
    from urc.problems import printable

    if arguments.words:
        raise Misuse("'urc repo list' takes no arguments")
    for repository in repositories().all():
        keeper = repository.keeper
        print(printable(f"{repository.name}  signed by {keeper}" if keeper else repository.name))
    return 0


def _search(arguments: argparse.Namespace) -> int:
    from urc.cli.packages import search_repositories

    return search_repositories(arguments.words, is_json=arguments.json)


def _index(arguments: argparse.Namespace) -> int:
    """Write a folder's index for a static web server; return 1 if a package was rejected."""
    from urc.packages.index_builder import make_index
    from urc.runtime.package_check import examine

    folder, codec = Path(_one(arguments, "DIR")), _codec(arguments)
    listing = make_index(folder, _name(arguments, folder), examine, codec)
    for fault in listing.faults:
        complain(f"not listed: {fault}")
    print(f"{folder / 'index.json'}  {len(listing.listed.packages)} package versions")
    if codec is not None:
        print(f"signed by {codec.signer}; renew the signature within {arguments.valid / 2:g} days"
              " with 'urc repo index' or a running 'urc repo serve'")  # fmt: skip
    return 1 if listing.faults else 0


def _codec(arguments: argparse.Namespace) -> "IndexSigner | None":
    """Return the signer of the index; None if the maintainer has no key."""
    from urc.cli.packages import signer
    from urc.packages.index_head import IndexSigner

    key = signer(arguments.key)
    return IndexSigner(key, arguments.valid * 86400.0) if key is not None else None


def _withdraw(arguments: argparse.Namespace) -> int:
    """Withdraw a version of a package, with a reason for its users."""
    if not (arguments.why or "").strip():
        raise Misuse("'urc repo withdraw' requires --why with a reason for users of the version")
    return _note(arguments, arguments.why.strip())


def _restore(arguments: argparse.Namespace) -> int:
    """Make a withdrawn version of a package available again."""
    return _note(arguments, "")


def _note(arguments: argparse.Namespace, why: str) -> int:
    from urc.packages.index_builder import withdraw
    from urc.packages.names import parse_key

    if len(arguments.words) != 3:
        raise Misuse(f"'urc repo {arguments.action}' requires DIR PACKAGE VERSION")
    folder, package, version = arguments.words
    entry = withdraw(Path(folder), parse_key(package), version, why, _codec(arguments))
    print(f"{entry} is withdrawn: {why}" if why else f"{entry} is available again")
    return 0


def _serve(arguments: argparse.Namespace) -> int:
    """Write a folder's index, and serve the folder until Ctrl-C or SIGTERM."""
    from urc.cli.event_loop import run_loop
    from urc.packages.server import repository_app
    from urc.runtime.package_check import examine_apart
    from urc.web.serve.connection import REQUEST_S
    from urc.web.serve.server import serve

    folder = Path(_one(arguments, "DIR"))
    tokens, codec = _tokens(arguments, folder), _codec(arguments)
    _index(arguments)
    if not is_loopback(arguments.host):
        complain(f"urc repo: anyone on the network of {arguments.host} can read this repository")

    async def work() -> int:
        renewing = asyncio.create_task(_renewing(folder, codec))
        try:
            await serve(
                repository_app(folder, tokens, examine_apart, codec),
                host=arguments.host,
                port=arguments.port,
                on_ready=_print_url,
                request_s=_ARCHIVE_S if tokens else REQUEST_S,
            )
        finally:
            renewing.cancel()
        return 0

    return run_loop(work(), code_when_ended=0)


async def _renewing(folder: Path, codec: "IndexSigner | None") -> None:
    """Renew the index's signature before it expires, while the repository is served."""
    from urc.packages.index_builder import renew
    from urc.packages.names import PackageError

    while codec is not None:
        await asyncio.sleep(_RENEW_S)
        try:
            await asyncio.to_thread(renew, folder, codec)
        except (PackageError, OSError) as error:
            complain(f"urc repo: the signature of the index cannot be renewed: {error}")


def _tokens(arguments: argparse.Namespace, folder: Path) -> "UploadTokens | None":
    """Return the upload tokens; None if there is no token file."""
    from urc.packages.tokens import UploadTokens

    file: Path | None = arguments.tokens
    if file is None:
        return None
    if file.resolve().is_relative_to(folder.resolve()):
        raise Misuse(
            f"{file}: this file is inside the published repository; move it to another folder"
        )
    UploadTokens(file).all()  # report mistakes now, not at the first upload
    return UploadTokens(file)


def _print_url(url: str) -> None:
    print(f"repository {url}", flush=True)


def _name(arguments: argparse.Namespace, folder: Path) -> str:
    name = str(arguments.name or folder.resolve().name or "repository")
    if len(name) > 200 or not name.isprintable():
        raise Misuse("--name must be one line of at most 200 characters")
    return name


_ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "add": _add,
    "remove": _remove,
    "list": _list,
    "search": _search,
    "index": _index,
    "serve": _serve,
    "withdraw": _withdraw,
    "restore": _restore,
    "token": token,
    "key": key,
    "unsigned": unsigned,
    "block": lambda arguments: repo_blocks.block(arguments, _codec(arguments)),
    "unblock": lambda arguments: repo_blocks.unblock(arguments, _codec(arguments)),
    "blocks": lambda arguments: repo_blocks.blocks(arguments, _codec(arguments)),
}
