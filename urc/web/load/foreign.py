"""Which widgets live in the page, and which in a frame of their own.

Floor 5. What ships with URC is part of the page. Every other widget is somebody else's program: it
is mounted in a sandboxed frame, unless whoever runs the server says that it is trusted.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import quote

from urc.model.widget import Widget
from urc.shipped import shipped

__all__ = ["OURS", "Border", "frame_url"]

OURS = frozenset({
    "alerts", "altitude", "attitude", "axis", "bar", "battery", "button", "camera", "checklist",
    "compass", "deadman", "depth", "dpad", "gamepad", "gauge", "hold-button", "iframe", "image",
    "joystick", "keyboard", "knob", "link", "log", "map", "markdown", "number", "pano360",
    "path-pad", "plot", "range", "recorder", "scan", "scene3d", "select", "sequence", "signal",
    "slider", "speed", "state", "stop", "switch", "table", "terminal", "text", "tilt", "value",
    "vector-pad",
})  # fmt: skip
"""Widgets that ship with URC. Named here, so that a folder beside theirs is not taken for one."""


@dataclass(frozen=True, slots=True)
class Border:
    """Tells foreign widgets from those that may share the page."""

    trusted: frozenset[str] = frozenset()
    """Names of foreign widgets that share it all the same."""

    @classmethod
    def of(cls, trusted: Iterable[str]) -> "Border":
        """Return the border that lets these widgets through."""
        return cls(frozenset(trusted))

    def is_foreign(self, widget: Widget) -> bool:
        """Return whether the widget has to live in a frame."""
        if widget.name in self.trusted:
            return False
        home = shipped("widgets")
        return widget.name not in OURS or widget.folder.resolve() != (home / widget.name).resolve()

    def styles(self, widgets: Iterable[Widget]) -> tuple[str, ...]:
        """Return the URLs of the widgets' style sheets, for a page.

        That of a foreign widget is not among them: it could change the whole page.
        """
        mine = dict.fromkeys(one.name for one in widgets if not self.is_foreign(one))
        return tuple(f"/widgets/{quote(name)}/widget.css" for name in mine)


def frame_url(widget: Widget) -> str:
    """Return where the frame of a foreign widget is."""
    return f"/frames/{quote(widget.name)}"
