"""The window of a browser, as scenes see it, whatever drives it."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

__all__ = ["Window"]


class Window(ABC):
    """One page in one window.

    Every method has a time limit, and fails with what the browser said.
    """

    name: str
    version: str

    @abstractmethod
    def goto(self, address: str) -> None:
        """Open a page, and wait until it has loaded."""

    @abstractmethod
    def evaluate(self, expression: str) -> Any:
        """Return the JSON value of a JavaScript expression, or of its promise."""

    @abstractmethod
    def press(self, x: float, y: float) -> None:
        """Move the pointer to a place of the page, and press its button."""

    @abstractmethod
    def move(self, x: float, y: float) -> None:
        """Move the pointer; a pressed button stays pressed."""

    @abstractmethod
    def release(self) -> None:
        """Release the button of the pointer."""

    @abstractmethod
    def resize(self, width: int, height: int) -> tuple[int, int]:
        """Set the size of the page; return the size that the window allows."""

    @abstractmethod
    def screenshot(self, file: Path) -> None:
        """Write a picture of the page as PNG."""

    @abstractmethod
    def faults(self) -> list[str]:
        """Return the console's errors so far, with exceptions and violations of the policy."""
