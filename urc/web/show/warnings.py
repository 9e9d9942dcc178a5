"""Warnings for every page of a server, shown at the top in red.

Layer 5. The access middleware sets the warnings for each request; the base template shows the
warnings.
"""

from contextvars import ContextVar
from typing import Final

__all__ = ["current_warnings"]

current_warnings: Final[ContextVar[tuple[str, ...]]] = ContextVar("urc_warnings", default=())
"""Warnings of the current request, in the user's language."""
