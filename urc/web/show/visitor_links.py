"""Navigation links that are visible only to some visitors.

Layer 5. The access middleware sets the links for each request; ``nav.html.j2`` shows the links.
"""

from contextvars import ContextVar
from typing import Final

__all__ = ["sees_audit"]

sees_audit: Final[ContextVar[bool]] = ContextVar("urc_sees_audit", default=False)
"""Whether the current request's visitor may open the audit log."""
