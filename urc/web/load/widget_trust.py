"""The rule for where a widget runs: in the page, or in a sandboxed frame.

Layer 5. URC's own widgets run in the page. Every other widget is third-party code and runs in a
sandboxed frame, unless the server was started with the option to trust it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import quote

from urc.model.widget import Widget
from urc.shipped import shipped

__all__ = ["OURS", "WidgetTrust", "frame_url"]

OURS = frozenset({
    "alerts", "altitude", "attitude", "axis", "bar", "battery", "button", "camera", "checklist",
    "compass", "deadman", "depth", "dpad", "gamepad", "gauge", "hold-button", "iframe", "image",
    "joystick", "keyboard", "knob", "link", "log", "map", "markdown", "number", "pano360",
    "path-pad", "plot", "range", "recorder", "scan", "scene3d", "select", "sequence", "signal",
    "slider", "speed", "state", "stop", "switch", "table", "terminal", "text", "tilt",
    "transforms", "value", "vector-pad",
})  # fmt: skip
"""Names of URC's own widgets. Widgets in all other folders are not trusted."""


@dataclass(frozen=True, slots=True)
class WidgetTrust:
    """The rule that identifies third-party widgets."""

    trusted: frozenset[str] = frozenset()
    """Names of third-party widgets that run in the page."""

    @classmethod
    def of(cls, trusted: Iterable[str]) -> "WidgetTrust":
        """Return the rule that trusts the named widgets."""
        return cls(frozenset(trusted))

    def is_foreign(self, widget: Widget) -> bool:
        """Return whether the widget must run in a frame."""
        if widget.name in self.trusted:
            return False
        home = shipped("widgets")
        return widget.name not in OURS or widget.folder.resolve() != (home / widget.name).resolve()

    def styles(self, widgets: Iterable[Widget]) -> tuple[str, ...]:
        """Return the URLs of the widgets' style sheets for a page.

        Style sheets of third-party widgets are omitted, because they could restyle the whole page.
        """
        mine = dict.fromkeys(one.name for one in widgets if not self.is_foreign(one))
        return tuple(f"/widgets/{quote(name)}/widget.css" for name in mine)


def frame_url(widget: Widget) -> str:
    """Return the frame URL of a third-party widget."""
    return f"/frames/{quote(widget.name)}"
