"""One parser for all subcommands, used by completion, the manual page and the reference.

Layer 6. `urc` itself never builds this parser, because each subcommand loads only its own parser.
"""

import argparse
from collections.abc import Container
from importlib import import_module

from urc.cli.arguments import describe
from urc.cli.verbs import GROUPS, VERBS, module_of

__all__ = ["command_tree"]

DESCRIPTION = "Describe a robot in one YAML file, and drive it from any browser."


def command_tree(only: Container[str] | None = None) -> argparse.ArgumentParser:
    """Return the parser for `urc`, with its subcommands.

    Args:
        only: subcommands to include with their arguments; None means all. Other subcommands are
            included by name only, so that their modules are not loaded.
    """
    parser = argparse.ArgumentParser(prog="urc", description=DESCRIPTION, allow_abbrev=False)
    parser.add_argument("--version", "-V", action="store_true", help="print the version")
    verbs = parser.add_subparsers(title="subcommands", dest="verb", metavar="SUBCOMMAND")
    for verb in (verb for group in GROUPS.values() for verb in group):
        made = verbs.add_parser(verb, help=VERBS[verb], allow_abbrev=False)
        if only is None or verb in only:
            describe(made, VERBS[verb], import_module(module_of(verb)))
    return parser
