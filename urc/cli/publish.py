"""`urc publish`: a package to a repository that takes packages."""

import argparse
from pathlib import Path

EXAMPLE = "urc publish lab/drivers/puppet --to https://robots.example/ --token-file token.txt"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to publish, and where."""
    parser.add_argument(
        "packages",
        metavar="DIR|PACKAGE",
        nargs="+",
        type=Path,
        help="folders or archives of packages, in this order: what another needs goes first",
    )
    parser.add_argument("--to", metavar="URL", required=True, help="the repository")
    parser.add_argument(
        "--token-file", metavar="FILE", type=Path, required=True, help="the token of its keeper"
    )
    parser.add_argument(
        "--key", metavar="FILE", type=Path, help="of the publisher (default: your own, if any)"
    )
    parser.add_argument(
        "--insecure", action="store_true", help="send the token where others can read it"
    )


def run(arguments: argparse.Namespace) -> int:
    """Send each package; what the repository refuses ends it with its reason."""
    from urc.cli.failures import Misuse
    from urc.cli.packages import signer
    from urc.packages.publish import is_overheard, publish
    from urc.packages.remote import repository_url
    from urc.packages.sources import open_source
    from urc.packages.tokens import read_token

    url = repository_url(arguments.to)
    if is_overheard(url) and not arguments.insecure:
        raise Misuse(
            f"{url} is not encrypted: anybody on the way can read the token; use https,"
            " or --insecure in a network that you trust"
        )
    token = read_token(arguments.token_file)
    key = signer(arguments.key)
    for path in arguments.packages:
        source = open_source(path.expanduser())
        package = next(one for one in source.packages if one.manifest.key == source.roots[0])
        said = package.manifest
        signature = source.signatures.get(package.digest)
        if signature is None and key is not None:
            signature = key.sign(said.key, said.version, package.digest)
        done = publish(url, package, signature, token)
        who = f"signed by {signature}" if signature else "not signed"
        print(f"{'published' if done.is_new else 'there already:'} {done.listed}, {who}")
    return 0
