"""Sign-in with an OpenID Connect provider: the authorization code flow with PKCE.

Layer 4. The sign-in follows OpenID Connect Core 1.0, RFC 7636 (PKCE) and RFC 9700 (security
practice).

Theory of operation. `begin` returns the address of the provider's page. The address contains a
random state, which is valid for one use within ten minutes. The state is valid only in the browser
that has the binding, so a link cannot sign a browser in to an attacker's account. `finish`
exchanges the code in the redirect for an ID token and checks the token. The token's claims
determine the grants.
"""

import asyncio
import hashlib
import importlib.util
import secrets
import time
from base64 import urlsafe_b64encode
from collections.abc import Callable, Mapping
from hmac import compare_digest
from typing import Any, Final, NamedTuple
from urllib.parse import urlencode, urlsplit

from urc._extras import missing
from urc.access.directory import digest_of
from urc.access.external_accounts import ExternalAccount
from urc.access.grants import AccessError
from urc.access.oidc_options import OidcOptions, claim_values
from urc.access.oidc_provider import OidcProvider
from urc.access.oidc_tokens import UnknownKey, verified_claims
from urc.access.pending import Pending

__all__ = ["STATE_S", "OidcRedirect", "OidcSignIn"]

STATE_S: Final = 600.0
"""Time limit for the sign-in at the provider, in seconds."""
_LONGEST_NAME: Final = 64
_LATE: Final = "the sign-in took too long, or began in another browser: try again"


class OidcRedirect(NamedTuple):
    """The redirect that begins a sign-in."""

    url: str
    """Address of the provider's sign-in page, to which the browser is redirected."""
    binding: str
    """Secret in a browser cookie during the sign-in at the provider."""


class _Flow(NamedTuple):
    nonce: str
    verifier: str
    redirect: str
    binding: bytes


class OidcSignIn:
    """Signs people in to one server through its identity provider."""

    def __init__(
        self,
        options: OidcOptions,
        provider: OidcProvider | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Initialize without contacting the provider.

        Args:
            options: the options.
            provider: the provider; None for the provider in the options.
            clock: function that returns monotonic time in seconds.

        Raises:
            AccessError: the extra `oidc` is not installed.
        """
        if importlib.util.find_spec("joserfc") is None:
            raise AccessError(missing("--oidc needs", "joserfc", "oidc"))
        self.options = options
        self._provider = provider or OidcProvider(options, clock)
        self._clock = clock
        self._pending: Pending[_Flow] = Pending(STATE_S)

    async def begin(self, redirect: str, place: str) -> OidcRedirect:
        """Return the address of the provider's page and the binding for one sign-in.

        Args:
            redirect: address on this server to which the provider redirects the browser.
            place: the browser's network address.

        Raises:
            AccessError: the provider is unreachable, or its description is invalid.
        """
        metadata = await self._provider.metadata()
        binding, nonce = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        verifier = secrets.token_urlsafe(64)
        flow = _Flow(nonce, verifier, redirect, digest_of(binding))
        query = {
            "response_type": "code",
            "client_id": self.options.client_id,
            "redirect_uri": redirect,
            "scope": " ".join(self.options.scopes),
            "state": self._pending.begin(flow, place, self._clock()),
            "nonce": nonce,
            "code_challenge": _challenge(verifier),
            "code_challenge_method": "S256",
        }
        joint = "&" if urlsplit(metadata.authorization).query else "?"
        return OidcRedirect(f"{metadata.authorization}{joint}{urlencode(query)}", binding)

    async def finish(self, answer: Mapping[str, str], binding: str, now: float) -> ExternalAccount:
        """Return the account with which the person signed in at the provider.

        Args:
            answer: the redirect's query parameters.
            binding: the secret in the browser's cookie; "" if there is no cookie.
            now: UTC time in seconds since 1970.

        Raises:
            AccessError: the sign-in was refused, took too long or began in another browser, or the
                provider's response is invalid.
        """
        # Each state allows one attempt, so it ends here in all cases.
        flow = self._pending.finish(answer.get("state", ""), self._clock())
        if flow is None or not compare_digest(flow.binding, digest_of(binding)):
            raise AccessError(_LATE)
        if answer.get("iss", self.options.issuer) != self.options.issuer:
            raise AccessError("the browser returned from a different provider")  # RFC 9207
        code, error = answer.get("code"), answer.get("error")
        if error or not code:
            reason = error if error and error.isidentifier() and len(error) <= 40 else "no code"
            raise AccessError(f"the provider refused the sign-in: {reason}")
        response = await self._provider.redeem(code, flow.verifier, flow.redirect)
        claims = await self._claims(response, flow.nonce, now)
        return ExternalAccount(
            self.options.issuer,
            claims["sub"],
            self._name(claims),
            self.options.grants(claims),
            self._ends_at(response, claims, now),
        )

    async def _claims(self, response: Mapping[str, Any], nonce: str, now: float) -> dict[str, Any]:
        """Return the ID token's claims; if the rules need more claims, request and add them."""
        token = response.get("id_token")
        if not isinstance(token, str):
            raise AccessError("the provider sent no ID token: is the scope 'openid' allowed?")

        async def checked(*, is_fresh: bool) -> dict[str, Any]:
            keys = await self._provider.keys(is_fresh=is_fresh)
            return await asyncio.to_thread(
                verified_claims, token, keys, issuer=self.options.issuer,
                client_id=self.options.client_id, nonce=nonce, now=now,
            )  # fmt: skip

        try:
            claims = await checked(is_fresh=False)
        except UnknownKey:
            claims = await checked(is_fresh=True)
        wanted = {rule.claim for rule in self.options.rules} | {self.options.name}
        access = response.get("access_token")
        if isinstance(access, str) and not all(claim_values(claims, name) for name in wanted):
            more = await self._provider.userinfo(access)
            # The response must describe the same account (OpenID Connect Core, 5.3.2).
            if more.get("sub") == claims["sub"]:
                claims = more | claims
        return claims

    def _name(self, claims: Mapping[str, Any]) -> str:
        for claim in (self.options.name, "preferred_username", "name", "email", "sub"):
            for value in claim_values(claims, claim):
                name = " ".join("".join(each for each in value if each.isprintable()).split())
                if name:
                    return name[:_LONGEST_NAME]
        return "?"

    def _ends_at(self, response: Mapping[str, Any], claims: Mapping[str, Any], now: float) -> float:
        """Return the UTC end of the sign-in, as limited by the options and the provider's session.

        The provider may report the end of its session in the claim ``session_expiry`` (OpenID
        Connect Enterprise Extensions) or in ``refresh_expires_in`` (Keycloak).
        """
        ends = [now + self.options.longest_s]
        until, lasts_s = claims.get("session_expiry"), response.get("refresh_expires_in")
        if isinstance(until, int | float) and until > now:
            ends.append(float(until))
        if isinstance(lasts_s, int | float) and lasts_s > 0:
            ends.append(now + lasts_s)
        return min(ends)


def _challenge(verifier: str) -> str:
    digest = hashlib.sha256(verifier.encode()).digest()
    return urlsafe_b64encode(digest).rstrip(b"=").decode()
