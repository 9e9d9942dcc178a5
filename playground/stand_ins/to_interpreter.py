"""A stand-in for `anyio.to_interpreter`: browsers lack further interpreters; URC uses none."""

from collections.abc import Callable
from typing import Any

__all__ = ["current_default_interpreter_limiter", "run_sync"]


async def run_sync(func: Callable[..., Any], *args: Any, limiter: Any = None) -> Any:
    """Raise RuntimeError."""
    raise RuntimeError("this Python has no further interpreters")


def current_default_interpreter_limiter() -> Any:
    """Raise RuntimeError."""
    raise RuntimeError("this Python has no further interpreters")
