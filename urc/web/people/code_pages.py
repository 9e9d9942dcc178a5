"""The pages for links with a code: a new device, an invited person, and a guest.

Layer 5. The pages are equal for all visitors; their modules read the code from the fragment.
"""

from dataclasses import dataclass
from typing import Final

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.web.serve.rights import ANYONE, ProtectedRoute
from urc.web.show.pages import PageHead, render
from urc.web.words import t

__all__ = ["OneTimeCodePage", "CodePages"]

_NO_STORE: Final = {"cache-control": "no-store"}


@dataclass(frozen=True, slots=True)
class OneTimeCodePage:
    """Context of ``pair.html.j2``, ``join.html.j2`` and ``guest.html.j2``."""

    head: PageHead


class CodePages:
    """The routes of the pages."""

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [ProtectedRoute(path, self.page, ANYONE) for path in ("/pair", "/join", "/guest")]

    async def page(self, request: Request) -> Response:
        """Show one of the pages."""
        name = request.url.path.strip("/")
        title = {
            "pair": t("Pair this device"),
            "join": t("Choose a passphrase"),
            "guest": t("Watch as a guest"),
        }[name]
        page = OneTimeCodePage(PageHead(request.state.nonce, title))
        return HTMLResponse(render(f"{name}.html.j2", page), headers=_NO_STORE)
