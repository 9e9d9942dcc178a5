"""The pages for people and devices: administration, the visitor's own account and codes.

Layer 5. The pages' modules fetch all data; the HTML contains no data. Pages for codes are identical
for all visitors; their modules read the code from the fragment.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.web.serve.rights import ADMINISTER, ANYONE, SIGNED_IN, ProtectedRoute
from urc.web.show.menu import Nav, NavigationLinks
from urc.web.show.pages import PageHead, render
from urc.web.words import t

__all__ = [
    "AccountPage",
    "CodePages",
    "GrantScope",
    "OneTimeCodePage",
    "PeoplePage",
    "PeoplePages",
]

_NO_STORE: Final = {"cache-control": "no-store"}


class GrantScope(NamedTuple):
    """A choice of robots to which a role applies: all robots, a tag or one robot."""

    value: str
    """Suffix of a grant: "", ``@cart`` or ``@#lab``."""
    title: str


@dataclass(frozen=True, slots=True)
class PeoplePage:
    """Context for ``people.html.j2``."""

    head: PageHead
    nav: Nav
    scopes: tuple[GrantScope, ...]
    robots: tuple[GrantScope, ...]
    """Choices of individual robots; each value is a robot's name in URLs."""


@dataclass(frozen=True, slots=True)
class AccountPage:
    """Context for ``account.html.j2``."""

    head: PageHead
    nav: Nav


@dataclass(frozen=True, slots=True)
class OneTimeCodePage:
    """Context for ``pair.html.j2``, ``join.html.j2`` and ``guest.html.j2``."""

    head: PageHead


class PeoplePages:
    """The routes of the administration and account pages."""

    def __init__(
        self,
        ways: NavigationLinks,
        robots: Callable[[], Mapping[str, str]],
        tags_of: Callable[[str], tuple[str, ...]],
    ) -> None:
        """Create the routes.

        Args:
            ways: navigation links of this server.
            robots: function that returns the titles of all robots, keyed by their names in URLs.
            tags_of: function that returns a robot's tags.
        """
        self._ways = ways
        self._robots = robots
        self._tags_of = tags_of

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [
            ProtectedRoute("/people", self.people, ADMINISTER),
            ProtectedRoute("/account", self.account, SIGNED_IN),
        ]

    async def people(self, request: Request) -> Response:
        """Show the administrator's page."""
        robots = self._robots()
        tags = sorted({tag for name in robots for tag in self._tags_of(name)})
        scopes = (
            GrantScope("", t("all robots")),
            *(GrantScope(f"@{name}", title) for name, title in robots.items()),
            *(GrantScope(f"@#{tag}", t("robots with the tag {tag}", tag=tag)) for tag in tags),
        )
        page = PeoplePage(
            PageHead(request.state.nonce, t("People")),
            Nav("people", self._ways),
            scopes,
            tuple(GrantScope(name, title) for name, title in robots.items()),
        )
        return HTMLResponse(render("people.html.j2", page), headers=_NO_STORE)

    async def account(self, request: Request) -> Response:
        """Show the visitor's own account page."""
        head = PageHead(request.state.nonce, t("Your account"))
        html = render("account.html.j2", AccountPage(head, Nav("account", self._ways)))
        return HTMLResponse(html, headers=_NO_STORE)


class CodePages:
    """The routes of the pages that open from links with codes, such as invitations."""

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [ProtectedRoute(path, self.page, ANYONE) for path in ("/pair", "/join", "/guest")]

    async def page(self, request: Request) -> Response:
        """Show the pairing, invitation or guest page."""
        name = request.url.path.strip("/")
        title = {
            "pair": t("Pair this device"),
            "join": t("Choose a passphrase"),
            "guest": t("Watch as a guest"),
        }[name]
        page = OneTimeCodePage(PageHead(request.state.nonce, title))
        return HTMLResponse(render(f"{name}.html.j2", page), headers=_NO_STORE)
