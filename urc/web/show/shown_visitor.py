"""A page's visitor, for display on the page.

Layer 5. The access middleware sets the visitor for each request; ``nav.html.j2`` and
``robot.html.j2`` show the visitor.
"""

from contextvars import ContextVar
from typing import Final, NamedTuple

__all__ = ["ShownVisitor", "shown_visitor"]


class ShownVisitor(NamedTuple):
    """A page's visitor."""

    name: str = ""
    """Name of the person, device or guest; "" for an unknown visitor."""
    may_administer: bool = False
    may_sign_in: bool = False
    """Whether the server has a store of people, so that unknown visitors can sign in."""
    names_screen: bool = False
    """Whether the visitor can name the screen, because the sign-in contains no name."""


shown_visitor: Final[ContextVar[ShownVisitor]] = ContextVar(
    "urc_shown_visitor",
    default=ShownVisitor(),  # noqa: B039 - immutable
)
"""The visitor of the current request."""
