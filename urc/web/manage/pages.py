"""The managers' pages as templates see them: a frame that ``manage.js`` fills.

Floor 5. Pure.
"""

from dataclasses import dataclass

from urc.web.show.menu import Nav, Ways
from urc.web.show.pages import Head, render
from urc.web.words import t

__all__ = ["KINDS", "ManagePage", "manage_page"]

KINDS = {
    "drivers": ("driver", "robot"),
    "interfaces": ("interface",),
    "widgets": ("widget",),
}
"""Page → kinds of packages that it is about."""


@dataclass(frozen=True, slots=True)
class ManagePage:
    """``manage.html.j2``: repositories, what is installed, what could be."""

    head: Head
    nav: Nav
    title: str
    about: str
    """What these packages are, in one sentence."""
    kinds: str
    """Kinds of packages, with commas between."""
    may_manage: bool
    """Whether who asks may change anything."""
    may_name_paths: bool
    """Whether a path of this machine may be named: only with the start key."""
    is_shown: bool
    """Whether the menu has what is installed."""


def manage_page(
    nonce: str,
    which: str,
    ways: Ways,
    *,
    may_manage: bool,
    may_name_paths: bool,
    is_shown: bool,
) -> str:
    """Return a manager's page; `which` is one of `KINDS`."""
    title, about = {
        "drivers": (
            t("Drivers"),
            t("How URC talks to a robot. A driver brings its widgets and interfaces along."),
        ),
        "interfaces": (
            t("Interfaces"),
            t("Where the widgets of a robot stand. Every robot that it fits offers it."),
        ),
        "widgets": (
            t("Widgets"),
            t("What shows a value, or gives a command."),
        ),
    }[which]
    page = ManagePage(
        Head(nonce, title),
        Nav(which, ways),
        title,
        about,
        ",".join(KINDS[which]),
        may_manage,
        may_name_paths,
        is_shown,
    )
    return render("manage.html.j2", page)
