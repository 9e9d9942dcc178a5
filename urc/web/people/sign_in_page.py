"""The sign-in page, which replaces the requested page for every visitor who has not signed in.

Layer 5. The page also has a STOP button for each robot that can move.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple
from urllib.parse import quote, unquote

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.types import Scope

from urc.web.serve.access import Access
from urc.web.serve.rights import ANYONE, ProtectedRoute
from urc.web.show.pages import PageHead, render

__all__ = ["AccessPage", "FurtherWays", "SignInPages", "Stoppable", "own_path"]

_HEADERS: Final = {"cache-control": "no-store"}
_REFUSED: Final = {**_HEADERS, "www-authenticate": 'Bearer realm="URC"'}


class Stoppable(NamedTuple):
    """One robot on the sign-in page, with the URL of its STOP."""

    name: str
    """The robot's name in URLs."""
    title: str

    @property
    def stop_url(self) -> str:
        """URL for STOP requests to the robot."""
        return f"/api/v1/robots/{quote(self.name, safe='')}/stop"


class FurtherWays(NamedTuple):
    """Sign-in methods in addition to the start key, pairing and passphrases."""

    has_passkeys: bool = False
    provider: str = ""
    """Displayed name of the identity provider; "" if there is no provider."""


@dataclass(frozen=True, slots=True)
class AccessPage:
    """Context for ``door.html.j2``: STOP, and sign-in methods or a link to the requested page."""

    head: PageHead
    url: str
    """Path of the requested page; "" if the browser may not open it yet."""
    is_old: bool
    """Whether the request had an invalid key, which the page then reports first."""
    path: str
    """Path and query of the page that opens after the sign-in. A browser that followed a link from
    another site sends no cookie. The browser sends the cookie once the user follows a link from the
    sign-in page to this path."""
    robots: tuple[Stoppable, ...]
    has_people: bool
    """Whether the server has people who can sign in with a name and a passphrase."""
    keeps_people: bool
    """Whether the server can pair devices."""
    ways: FurtherWays


class SignInPages:
    """The sign-in pages of one server."""

    def __init__(
        self,
        access: Access,
        robots: Callable[[], Iterable[Stoppable]],
        ways: FurtherWays = FurtherWays(),  # noqa: B008 - immutable
    ) -> None:
        """Create the pages.

        Args:
            access: the identities and rights of the server.
            robots: function that returns all robots that can move.
            ways: additional sign-in methods.
        """
        self._access = access
        self._robots = robots
        self._ways = ways

    def routes(self) -> list[ProtectedRoute]:
        """Return the sign-in page's route, for visitors who want to change their identity."""
        return [ProtectedRoute("/sign-in", self.page, ANYONE)]

    async def page(self, request: Request) -> Response:
        """Show the sign-in page; the query parameter ``to`` is the path to open afterwards."""
        found = self.response(request.scope, path=own_path(request.query_params.get("to", "/")))
        found.status_code = 200
        del found.headers["www-authenticate"]
        return found

    def response(
        self, scope: Scope, *, url: str = "", is_old: bool = False, path: str = ""
    ) -> HTMLResponse:
        """Return the sign-in page.

        Args:
            scope: ASGI scope of the request.
            url: path of the requested page; "" if the browser may not open it yet.
            is_old: whether the request had an invalid key.
            path: path of the page that opens after the sign-in; "" for the requested page.
        """
        parts = scope["path"].split("/")
        robots = tuple(() if url else self._robots())
        asked = unquote(parts[2]) if parts[1:2] == ["robots"] and len(parts) > 2 else ""
        people = self._access.control.directory.principals.values()
        context = AccessPage(
            head=PageHead(scope["state"]["nonce"], "URC"),
            url=url,
            is_old=is_old,
            path=path or _requested(scope),
            robots=tuple(one for one in robots if one.name == asked) or robots,
            has_people=any(one.kind == "person" and one.id != "local" for one in people),
            keeps_people=self._access.control.store is not None,
            ways=self._ways,
        )
        html = render("door.html.j2", context)
        is_in = url and not is_old
        return HTMLResponse(html, 200 if is_in else 401, _HEADERS if is_in else _REFUSED)


def own_path(path: str) -> str:
    r"""Return `path`, or "/" if a browser could read it as another host.

    Browsers interpret ``//host`` and ``/\host`` as another host.
    """
    is_ours = path.startswith("/") and path[1:2] not in ("/", "\\") and path.isprintable()
    return path if is_ours and path.isascii() else "/"


def _requested(scope: Scope) -> str:
    """Return a request's path and query; never "//…", which browsers read as another host."""
    path = "/" + quote(scope["path"].lstrip("/"))
    query: Any = scope["query_string"].decode("latin-1")
    return f"{path}?{query}" if query else path
