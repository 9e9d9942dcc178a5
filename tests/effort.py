"""How many examples a property is tried on.

The everyday run is quick; ``URC_THOROUGH=1`` tries twelve times as many.
"""

import os

__all__ = ["IS_THOROUGH", "examples"]

IS_THOROUGH = bool(os.environ.get("URC_THOROUGH"))


def examples(thorough: int) -> int:
    """Return the number for this run, out of the number for a thorough one."""
    return thorough if IS_THOROUGH else max(10, thorough // 12)
