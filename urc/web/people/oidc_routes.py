"""Routes for signing in with an identity provider: the redirect to the provider, and the return.

Layer 5. A sign-in begins with a POST request from one of URC's pages. The provider redirects the
browser to `CALLBACK`. The response to `CALLBACK` is a page, because browsers send
``SameSite=Strict`` cookies only after navigation from a page of URC.
"""

import asyncio
from dataclasses import dataclass
from typing import Final

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.access.external_accounts import admit_account
from urc.access.grants import AccessError
from urc.access.oidc import STATE_S, OidcSignIn
from urc.web.people.browser_sign_ins import BrowserSignIns, address_of, answers_refusals
from urc.web.people.passkey_messages import ProviderAddress
from urc.web.serve.replies import ApiError, answer
from urc.web.serve.rights import ANYONE, ProtectedRoute
from urc.web.show.pages import PageHead, render

__all__ = ["CALLBACK", "OidcRoutes", "ProviderPage"]

CALLBACK: Final = "/sign-in/oidc/callback"
"""Path of the redirect URL, which must be registered with the provider."""
_COOKIE: Final = "urc-provider-"
_NO_STORE: Final = {"cache-control": "no-store"}


@dataclass(frozen=True, slots=True)
class ProviderPage:
    """Context for ``provider.html.j2``: the result of a sign-in with the provider."""

    head: PageHead
    fault: str
    """Reason why the sign-in failed; "" after success."""
    title: str
    """Displayed name of the provider."""


class OidcRoutes:
    """The routes for signing in with a provider; without a provider, both refuse requests."""

    def __init__(self, sign_ins: BrowserSignIns, provider: OidcSignIn | None) -> None:
        """Create the routes.

        Args:
            sign_ins: the sign-ins of all browsers.
            provider: the sign-ins with the provider; None if the server has no provider.
        """
        self._sign_ins = sign_ins
        self._known = provider
        self._cookie = _COOKIE + sign_ins.access.instance

    @property
    def title(self) -> str:
        """Text of the button on the sign-in page; "" if there is no provider."""
        return self._known.options.title if self._known else ""

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [
            ProtectedRoute("/sign-in/oidc", self.begin, ANYONE, methods=["POST"]),
            ProtectedRoute(CALLBACK, self.finish, ANYONE),
        ]

    @answers_refusals
    async def begin(self, request: Request) -> Response:
        """Begin a sign-in; return the address of the provider's page."""
        self._sign_ins.check_wait(request)
        # The page policy has accepted the request's address, and the provider checks it again.
        address = self._provider.options.address or _origin(request)
        try:
            begun = await self._provider.begin(address + CALLBACK, address_of(request))
        except AccessError as error:
            raise ApiError(502, str(error)) from None
        done = answer(ProviderAddress(begun.url))
        done.headers.append("set-cookie", self._kept(request, begun.binding, round(STATE_S)))
        return done

    async def finish(self, request: Request) -> Response:
        """Sign in a person whom the provider has redirected here."""
        fault, status = "", 200
        page = HTMLResponse(headers=_NO_STORE)
        try:
            self._sign_ins.check_wait(request)
            await self._sign_in(request, page)
        except ApiError as failure:
            fault, status = failure.line, failure.status
        except AccessError as error:
            self._sign_ins.failed(request, "oidc", error)
            fault, status = str(error), 403
        page.headers.append("set-cookie", self._kept(request, "", 0))
        page.status_code = status
        context = ProviderPage(PageHead(request.state.nonce, "URC"), fault, self.title)
        page.body = render("provider.html.j2", context).encode()
        page.headers["content-length"] = str(len(page.body))
        return page

    async def _sign_in(self, request: Request, response: Response) -> None:
        binding = request.cookies.get(self._name(request), "")
        now = self._sign_ins.control.now()
        query = dict(request.query_params)
        account = await self._provider.finish(query, binding, now)
        try:
            person = await asyncio.to_thread(admit_account, self._sign_ins.store, account, now)
        finally:
            # Even a refusal may have ended roles.
            await self._sign_ins.control.reload()
        await self._sign_ins.open(request, response, person, "oidc", ends_at=account.ends_at)

    @property
    def _provider(self) -> OidcSignIn:
        if self._known is None:
            raise ApiError(404, "this server has no identity provider: see --oidc")
        return self._known

    def _name(self, request: Request) -> str:
        return f"__Host-{self._cookie}" if request.url.scheme == "https" else self._cookie

    def _kept(self, request: Request, binding: str, lasts_s: int) -> str:
        """Return the cookie that binds a sign-in to the browser.

        The cookie is not ``SameSite=Strict``, because the browser returns from the provider's site.
        """
        secure = "; Secure" if request.url.scheme == "https" else ""
        return (
            f"{self._name(request)}={binding}; Max-Age={lasts_s}; Path=/; HttpOnly; SameSite=Lax"
            f"{secure}"
        )


def _origin(request: Request) -> str:
    return f"{request.url.scheme}://{request.headers['host']}"
