"""Check the pages in WebKit; see `bench.other_browsers`."""

from collections.abc import Sequence

from bench.harness import Result
from bench.other_browsers import checked
from tests.e2e.browsers.webkit import webkit_window

__all__ = ["run"]


def run(*, full: bool) -> Sequence[Result]:
    """Check the pages."""
    return checked(webkit_window, full=full)
