"""What a robot's documents name for their widgets, as routes: files, and pages of somebody else.

Floor 5. A page is shown by a document that can do nothing else: no script, one frame. The
dashboard's own policy lets it frame only what is ours. So this document frames the other page, and
its policy names the one origin that the option of a widget names.
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
from starlette.routing import Route

from urc.model.profile import Profile
from urc.web import words
from urc.web.fleet.robots import Robot
from urc.web.load.files import page_key, robot_file, uses_of
from urc.web.serve.policy import is_origin_ours, parse_host
from urc.web.show.pages import render

__all__ = ["FramedPage", "Linked", "framed_page"]

# White, as pages expect that bring no colour of their own; a dark one paints its own ground.
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
    """``framed.html.j2``: the document around one page of somebody else."""

    title: str
    """Its host."""
    url: str
    """"" when it is not shown."""
    fault: str
    """One line: why it is not shown."""
    style: Markup = _STYLE
    """The policy names its digest, so it is written exactly so."""


class Linked:
    """The routes.

    Args:
        robots: all that are served now, by the name in their URL.
    """

    def __init__(self, robots: Callable[[], Mapping[str, Robot]]) -> None:
        self._robots = robots

    def routes(self) -> list[Route]:
        """Return them, to be put into the application."""
        return [
            Route("/robots/{name}/files/{file:path}", self._file),
            Route("/robots/{name}/framed/{page}", self._page),
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
    """Return the document around a page that an option names; raise 404 for any other.

    A page of the very server that is asked is not shown: in a frame it could reach the dashboard.
    """
    pages = (many for use in uses_of(profile) for many in use.pages.values())
    urls = {page_key(url): url for many in pages for url in many}
    url = urls.get(key)
    if url is None:
        raise HTTPException(404)
    parts = urlsplit(url)
    origin = f"{parts.scheme}://{parts.netloc}".lower()
    is_ours = _is_ours(origin, parts.netloc, request)
    fault = words.t("this is a page of the dashboard itself, which is not shown here")
    page = FramedPage(parts.netloc, "" if is_ours else url, fault if is_ours else "")
    request.state.frame_policy = _POLICY.format(frames="'none'" if is_ours else origin)
    html = render("framed.html.j2", page)
    return HTMLResponse(html, 404 if is_ours else 200, headers={"cache-control": "no-store"})


def _is_ours(origin: str, netloc: str, request: Request) -> bool:
    ours = parse_host(request.headers.get("host", ""))
    # Behind a proxy the scheme that we see may not be the browser's: the same words are enough.
    return (
        ours is None
        or parse_host(netloc) == ours
        or is_origin_ours(origin, request.scope["scheme"], ours)
    )
