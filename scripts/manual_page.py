"""Generate the manual page urc(1) from the subcommands' parsers with argparse-manpage."""

import os

from urc import __version__
from urc.cli.command_tree import command_tree

__all__ = ["manual_page"]

SUMMARY = "describe a robot in one YAML file, and drive it from any browser"
COLUMNS = "80"


def manual_page(date: str) -> str:
    """Return the page in man(7) markup.

    Args:
        date: release date, such as ``2026-11-28``. The same sources and the same date
            produce the same page.
    """
    from argparse_manpage.manpage import Manpage

    os.environ["COLUMNS"] = COLUMNS  # argparse wraps lines at the terminal's width
    page = Manpage(command_tree(), format="single-commands-section")
    page.date = date
    page.source = f"urc {__version__}"
    page.manual = "Universal Robot Controller"
    page.description = SUMMARY
    return str(page)
