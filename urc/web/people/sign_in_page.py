"""The sign-in page, which each visitor without a sign-in gets in place of the requested page.

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
    """A robot that STOP can stop."""

    name: str
    """Name of the robot in URLs."""
    title: str

    @property
    def stop_url(self) -> str:
        """The URL of the robot's STOP."""
        return f"/api/v1/robots/{quote(self.name, safe='')}/stop"


class FurtherWays(NamedTuple):
    """Ways to sign in, besides the start key, pairing and passphrases."""

    has_passkeys: bool = False
    provider: str = ""
    """Name of the identity provider for people; "" without one."""


@dataclass(frozen=True, slots=True)
class AccessPage:
    """Context of ``door.html.j2``: the ways to sign in or a link to the page, and STOP buttons."""

    head: PageHead
    url: str
    """Path of the requested page, if the browser may open it now; "" if not."""
    is_old: bool
    """Whether the request had an invalid key; the page reports an invalid key first."""
    path: str
    """Path and query of the page that opens after the sign-in. A browser that followed a link on
    another site sends no cookie; with a link to this path, it does."""
    robots: tuple[Stoppable, ...]
    has_people: bool
    """Whether the server knows people, who may sign in with name and passphrase."""
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
        """Prepare.

        Args:
            access: the identities and rights of the server.
            robots: function that returns all robots that STOP can stop.
            ways: further ways to sign in.
        """
        self._access = access
        self._robots = robots
        self._ways = ways

    def routes(self) -> list[ProtectedRoute]:
        """Return the route of the page itself, for visitors that want another identity."""
        return [ProtectedRoute("/sign-in", self.page, ANYONE)]

    async def page(self, request: Request) -> Response:
        """Show the sign-in page; the query ``to`` is the path of the next page."""
        found = self.response(request.scope, path=own_path(request.query_params.get("to", "/")))
        found.status_code = 200
        del found.headers["www-authenticate"]
        return found

    def response(
        self, scope: Scope, *, url: str = "", is_old: bool = False, path: str = ""
    ) -> HTMLResponse:
        """Return the page.

        Args:
            scope: ASGI scope of the request.
            url: path of the requested page, if the browser may open it now.
            is_old: whether the request had an invalid key.
            path: path of the page that opens after the sign-in; "": the requested page.
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
    r"""Return a path of this server, or "/" for a text that could lead to another one.

    Browsers read ``//host`` and ``/\host`` as another host.
    """
    is_ours = path.startswith("/") and path[1:2] not in ("/", "\\") and path.isprintable()
    return path if is_ours and path.isascii() else "/"


def _requested(scope: Scope) -> str:
    """Return path and query of a request; never "//…", which would be another host."""
    path = "/" + quote(scope["path"].lstrip("/"))
    query: Any = scope["query_string"].decode("latin-1")
    return f"{path}?{query}" if query else path
