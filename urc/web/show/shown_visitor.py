"""The visitor of a page, as the page shows it.

Layer 5. The access middleware sets it for each request; ``nav.html.j2`` and ``robot.html.j2`` show
it.
"""

from contextvars import ContextVar
from typing import Final, NamedTuple

__all__ = ["ShownVisitor", "shown_visitor"]


class ShownVisitor(NamedTuple):
    """The visitor of a page."""

    name: str = ""
    """Name of the person, device or guest; "" for an unknown visitor."""
    may_administer: bool = False
    may_sign_in: bool = False
    """Whether the server keeps people, so that an unknown visitor can sign in."""
    names_screen: bool = False
    """Whether the visitor names its screen, because its sign-in has no name of its own."""


shown_visitor: Final[ContextVar[ShownVisitor]] = ContextVar(
    "urc_shown_visitor",
    default=ShownVisitor(),  # noqa: B039 - immutable
)
"""The visitor of the current request."""
