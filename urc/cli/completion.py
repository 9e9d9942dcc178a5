"""`urc completion`: print the script that completes `urc` in a shell.

At each press of Tab, argcomplete runs `urc` with the command line in the environment. The
completions therefore match the installed version and include the robots on this machine.
"""

import argparse
import os
from collections.abc import Callable, Iterable
from pathlib import Path

from urc.shipped import shipped

EXAMPLE = "urc completion bash > urc-completion.bash"
SHELLS = ("bash", "zsh", "fish")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line argument: the shell."""
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help="bash, zsh or fish")


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["urc"], shell=arguments.shell).strip())
    return 0


def answer() -> None:
    """Print the completions for one press of Tab, using argcomplete's variables, and exit."""
    import argcomplete

    from urc.cli.command_tree import command_tree
    from urc.cli.verbs import VERBS

    typed = os.environ.get("COMP_LINE", "").split()[1:]
    verb = next((word for word in typed if word in VERBS), "")
    tree = command_tree({verb})
    for parser in (tree, *_parsers_of(tree)):
        for action in parser._actions:  # noqa: SLF001 - argparse has no public list
            if complete := _COMPLETERS.get(str(action.metavar)):
                action.completer = complete  # type: ignore[attr-defined]  # as argcomplete expects
    argcomplete.autocomplete(tree)


def _parsers_of(tree: argparse.ArgumentParser) -> Iterable[argparse.ArgumentParser]:
    """Yield the parser of each subcommand in the tree."""
    for action in tree._actions:  # noqa: SLF001 - argparse has no public list
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - the type has no other name
            yield from action.choices.values()


def _robots(prefix: str, **_: object) -> list[str]:
    """Return all robot names, and the documents in the folder of `prefix`, unfiltered."""
    from urc._folders import data_folder
    from urc.packages.store import Store

    shipped_names = {file.stem for file in shipped("robots").glob("*.yaml")}
    installed = {
        lock.key.name
        for lock in Store(data_folder() / "packages").installed()
        if lock.key.kind in ("robot", "driver")
    }
    return [*sorted(shipped_names | installed), *_documents(prefix)]


def _documents(prefix: str, **_: object) -> list[str]:
    """Return the YAML files and folders in the folder of `prefix`; argcomplete filters them."""
    folder = Path(prefix).parent if not prefix.endswith("/") else Path(prefix)
    try:
        found = sorted(folder.iterdir())
    except OSError:
        return []
    folders = [f"{path}/" for path in found if path.is_dir() and not path.name.startswith(".")]
    return [*(str(path) for path in found if path.suffix in (".yaml", ".yml")), *folders]


_COMPLETERS: dict[str, Callable[..., list[str]]] = {"PROFILE": _robots, "PATH": _robots}
"""Completion function for each metavar; arguments with other metavars complete to file names."""
