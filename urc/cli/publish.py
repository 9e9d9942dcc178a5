"""`urc publish`: upload packages to a repository."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from urc.packages.sources import FileSource
    from urc.packages.version_notes import Provenance
    from urc.problems import Problem

_TOLD_MOST = 5
EXAMPLE = "urc publish lab/drivers/puppet --to https://robots.example/ --token-file token.txt"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: packages and repository."""
    parser.add_argument(
        "packages",
        metavar="DIR|PACKAGE",
        nargs="+",
        type=Path,
        help="folders or archives of packages, dependencies first",
    )
    parser.add_argument("--to", metavar="URL", required=True, help="the repository")
    parser.add_argument(
        "--token-file",
        metavar="FILE",
        type=Path,
        required=True,
        help="file with the upload token from the maintainer of the repository",
    )
    parser.add_argument(
        "--key",
        metavar="FILE",
        type=Path,
        help="key of the publisher (default: your own key, if you have one)",
    )
    parser.add_argument(
        "--source",
        metavar="URL",
        default="",
        help="URL of the source code, shown before installation",
    )
    parser.add_argument("--commit", metavar="HEX", default="", help="commit of --source")
    parser.add_argument(
        "--allow-warnings", action="store_true", help="publish despite warnings of 'urc validate'"
    )
    parser.add_argument(
        "--insecure", action="store_true", help="permit sending the token without encryption"
    )


def run(arguments: argparse.Namespace) -> int:
    """Upload each package; stop at the first rejected package."""
    from urc.cli.error_report import Misuse
    from urc.cli.packages import signer
    from urc.packages.http_repository import repository_url
    from urc.packages.publish import is_overheard, publish
    from urc.packages.sources import open_source
    from urc.packages.tokens import read_token

    url = repository_url(arguments.to)
    if is_overheard(url) and not arguments.insecure:
        raise Misuse(
            f"{url} is not encrypted: an attacker on the network can read the token; use https,"
            " or add --insecure on a trusted network"
        )
    token, made = read_token(arguments.token_file), _provenance(arguments)
    key = signer(arguments.key)
    for path in arguments.packages:
        source = open_source(path.expanduser())
        package = next(one for one in source.packages if one.manifest.key == source.roots[0])
        _look(source, path.expanduser() / package.manifest.main, arguments)
        said = package.manifest
        signature = source.signatures.get(package.digest)
        if signature is None and key is not None:
            signature = key.sign(said.key, said.version, package.digest)
        done = publish(url, package, signature, token, made)
        who = f"signed by {signature}" if signature else "not signed"
        print(f"{'published' if done.is_new else 'already there:'} {done.listed}, {who}")
    return 0


def _provenance(arguments: argparse.Namespace) -> "Provenance | None":
    """Return the origin of the packages from the options; None without these options."""
    import msgspec

    from urc import __version__
    from urc.cli.error_report import Misuse
    from urc.packages.names import PackageError
    from urc.packages.version_notes import Provenance

    if not arguments.source:
        if arguments.commit:
            raise Misuse("--commit needs --source, the repository of the commit")
        return None
    said = {"source": arguments.source, "commit": arguments.commit, "tool": f"urc {__version__}"}
    try:
        made = msgspec.convert(said, Provenance)
        made.check()
    except (msgspec.ValidationError, PackageError) as error:
        raise Misuse(f"--source and --commit: {error}") from None
    return made


def _look(source: "FileSource", document: Path, arguments: argparse.Namespace) -> None:
    """Reject a package folder with problems; the repository itself checks packed archives.

    Raises:
        PackageError: the document has errors, or warnings that are not permitted.
    """
    from urc.packages.names import PackageError
    from urc.problems import has_errors
    from urc.runtime.package_check import problems

    if not source.is_folder:
        return
    found = problems(document)
    if document.name == "widget.yaml" and not has_errors(found):
        found += _of_files(document)
    if arguments.allow_warnings:
        found = [one for one in found if one.severity == "error"]
    if found:
        told = "; ".join(problem.headline for problem in found[:_TOLD_MOST])
        only = all(one.severity == "warning" for one in found)
        hint = "; --allow-warnings publishes the package despite warnings" if only else ""
        raise PackageError(f"{told}{hint}")


def _of_files(manifest: Path) -> "list[Problem]":
    """Return the problems in a widget's files."""
    from urc.config.load import WidgetFolder, check
    from urc.runtime.registries import built_in_catalog
    from urc.shipped import shipped
    from urc.web.show.widget_check import check_widget

    widget = check(manifest, built_in_catalog(), WidgetFolder(shipped("widgets"))).widget
    return [] if widget is None else check_widget(widget, with_demo=False)
