"""Routes for the files and third-party pages that a robot's documents list for widgets.

Layer 5. A document without scripts displays a third-party page in a frame. The dashboard's policy
permits only frames from the dashboard's own origin. The document around the third-party page has a
separate policy, which permits only the origin in the widget's option.
"""

import base64
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from markupsafe import Markup
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.model.profile import Profile
from urc.web import words
from urc.web.fleet.robots import Robot
from urc.web.load.files import page_key, robot_file
from urc.web.serve.policy import is_origin_ours, parse_host
from urc.web.serve.rights import WATCH, ProtectedRoute
from urc.web.show.pages import render

__all__ = ["FramedPage", "ExternalPages", "framed_page"]

# White, as pages without a background expect; a dark page paints its own background.
_STYLE: Final = Markup(
    "html,body,iframe{display:block;width:100%;height:100%;margin:0;border:0;background:white}"
)
_DIGEST: Final = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
_POLICY: Final = (
    f"default-src 'none'; frame-src {{frames}}; style-src 'sha256-{_DIGEST}'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'"
)


@dataclass(frozen=True, slots=True)
class FramedPage:
    """Context for ``framed.html.j2``: the document around one third-party page."""

    title: str
    """Host name of the third-party page."""
    url: str
    """URL of the third-party page; "" for a refused page."""
    fault: str
    """Reason why the page is refused, in one line; "" for a permitted page."""
    style: Markup = _STYLE
    """Exact text of the style; the policy contains the text's digest."""


class ExternalPages:
    """The routes for files and third-party pages.

    Args:
        robots: function that returns the served robots, keyed by their names in URLs.
    """

    def __init__(self, robots: Callable[[], Mapping[str, Robot]]) -> None:
        self._robots = robots

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes for files and third-party pages."""
        return [
            ProtectedRoute("/robots/{name}/files/{file:path}", self._file, WATCH),
            ProtectedRoute("/robots/{name}/framed/{page}", self._page, WATCH),
        ]

    async def _file(self, request: Request) -> Response:
        return robot_file(self._profile(request), request.path_params["file"], request)

    async def _page(self, request: Request) -> Response:
        return framed_page(self._profile(request), request.path_params["page"], request)

    def _profile(self, request: Request) -> Profile:
        robot = self._robots().get(request.path_params["name"])
        if robot is None:
            raise HTTPException(404)
        return robot.profile


def framed_page(profile: Profile, key: str, request: Request) -> Response:
    """Return the document around a page from a widget option; raise status 404 for other pages.

    Pages from this server are refused, because they could access the dashboard from the frame.
    """
    pages = (many for use in profile.uses() for many in use.pages.values())
    urls = {page_key(url): url for many in pages for url in many}
    url = urls.get(key)
    if url is None:
        raise HTTPException(404)
    parts = urlsplit(url)
    origin = f"{parts.scheme}://{parts.netloc}".lower()
    is_ours = _is_ours(origin, parts.netloc, request)
    fault = words.t("pages of the dashboard itself cannot be shown here")
    page = FramedPage(parts.netloc, "" if is_ours else url, fault if is_ours else "")
    request.state.frame_policy = _POLICY.format(frames="'none'" if is_ours else origin)
    html = render("framed.html.j2", page)
    return HTMLResponse(html, 404 if is_ours else 200, headers={"cache-control": "no-store"})


def _is_ours(origin: str, netloc: str, request: Request) -> bool:
    ours = parse_host(request.headers.get("host", ""))
    # Behind a proxy the scheme here may differ from the browser's; host and port are enough.
    return (
        ours is None
        or parse_host(netloc) == ours
        or is_origin_ours(origin, request.scope["scheme"], ours)
    )
