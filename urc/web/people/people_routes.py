"""All of a server's routes for people, devices, tokens and sign-ins.

Layer 5. The module only combines other modules of this package.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from urc.web.people.account_routes import AccountRoutes
from urc.web.people.admin_routes import AdminRoutes
from urc.web.people.link_maker import LinkMaker
from urc.web.people.pages import CodePages, PeoplePages
from urc.web.people.pairing_routes import PairingRoutes
from urc.web.people.pairings import Pairings
from urc.web.people.sign_in_page import FurtherWays, SignInPages, Stoppable
from urc.web.people.sign_in_routes import SignInRoutes
from urc.web.people.ways_in import WaysIn
from urc.web.serve.replies import Endpoint
from urc.web.serve.rights import ProtectedRoute
from urc.web.show.menu import NavigationLinks

__all__ = ["PeopleRoutes"]


class PeopleRoutes:
    """The routes for people, devices, tokens and sign-ins."""

    def __init__(
        self,
        ways_in: WaysIn,
        *,
        stoppable: Callable[[], Iterable[Stoppable]],
        robots: Callable[[], Mapping[str, str]],
        tags_of: Callable[[str], tuple[str, ...]],
        ways: NavigationLinks,
        data: Path | None,
    ) -> None:
        """Create the routes.

        Args:
            ways_in: the sign-in methods.
            stoppable: function that returns all robots that can move.
            robots: function that returns the titles of all robots, keyed by their names in URLs.
            tags_of: function that returns a robot's tags.
            ways: navigation links of this server.
            data: the data folder; None if the server has no data folder.
        """
        sign_ins = ways_in.sign_ins
        further = FurtherWays(sign_ins.control.store is not None, ways_in.oidc.title)
        self.pages = SignInPages(sign_ins.access, stoppable, further)
        """The sign-in pages."""
        pairings = Pairings()
        links = LinkMaker(sign_ins, pairings, data)
        self._pages = (self.pages, CodePages(), PeoplePages(ways, robots, tags_of))
        self._calls = (
            SignInRoutes(sign_ins),
            PairingRoutes(sign_ins, pairings, robots),
            AdminRoutes(sign_ins, pairings, links),
            AccountRoutes(sign_ins, links),
        )

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the API endpoints, keyed by call name."""
        return {name: one for part in self._calls for name, one in part.endpoints().items()}

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes for the pages."""
        return [route for one in self._pages for route in one.routes()]
