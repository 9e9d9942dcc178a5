"""Requests to an OpenID Connect provider for its description, its keys, and tokens.

Layer 4. Every request ends within `TOTAL_S`, responses are limited to `MOST_BYTES`, and redirects
are not followed. The description and the keys are cached for one hour. After a failure, the next
attempt is delayed, so visitors to the sign-in page cannot make this server flood the provider.
"""

import asyncio
import json
import ssl
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple
from urllib.parse import quote

import httpx2

from urc.access.grants import AccessError
from urc.access.oidc_options import OidcOptions
from urc.access.options_file import is_loopback_host

__all__ = ["KEPT_S", "MOST_BYTES", "OidcProvider", "ProviderMetadata", "TOTAL_S"]

TOTAL_S: Final = 10.0
"""Timeout for one request, in seconds."""
MOST_BYTES: Final = 262_144
"""Largest permitted response, in bytes."""
KEPT_S: Final = 3600.0
"""Time for which the description and the keys are cached, in seconds."""
_CONNECT_S: Final = 5.0
_RETRY_S: Final = 5.0
_OTHER_KEYS_S: Final = 60.0
"""Minimum time between two requests for the keys, in seconds."""
_PATH: Final = "/.well-known/openid-configuration"


class ProviderMetadata(NamedTuple):
    """The parts of a provider's description that a sign-in needs (OpenID Connect Discovery, 3)."""

    authorization: str
    """Address of the provider's sign-in page."""
    token: str
    """Address at which a code is exchanged for tokens (``token_endpoint``)."""
    keys: str
    """Address of the provider's public keys (``jwks_uri``)."""
    userinfo: str = ""
    """Address for requesting more claims (``userinfo_endpoint``); "" without such an address."""
    is_secret_posted: bool = False
    """Whether the provider accepts this server's secret only in the request body."""


class OidcProvider:
    """One server's provider."""

    def __init__(self, options: OidcOptions, clock: Callable[[], float] = time.monotonic) -> None:
        """Store the options; the first sign-in triggers the first request.

        Args:
            options: the options.
            clock: function that returns monotonic time in seconds.
        """
        self._options = options
        self._clock = clock
        self._lock = asyncio.Lock()
        self._trust: ssl.SSLContext | None = None
        self._metadata: ProviderMetadata | None = None
        self._metadata_at = 0.0
        self._failure = ""
        self._failed_at = 0.0
        self._keys: list[dict[str, Any]] = []
        self._keys_at = float("-inf")

    async def metadata(self) -> ProviderMetadata:
        """Return the provider's description, from the cache if possible.

        Raises:
            AccessError: the provider is unreachable, or its description is invalid.
        """
        async with self._lock:
            now = self._clock()
            if self._metadata is not None and now - self._metadata_at < KEPT_S:
                return self._metadata
            if self._failure and now - self._failed_at < _RETRY_S:
                raise AccessError(self._failure)
            url = self._options.issuer.rstrip("/") + _PATH
            try:
                found = _parsed(await self._ask("GET", url), self._options.issuer)
            except AccessError as error:
                self._failure, self._failed_at = str(error), self._clock()
                raise
            self._failure = ""
            self._metadata, self._metadata_at = found, self._clock()
            return found

    async def keys(self, *, is_fresh: bool = False) -> list[dict[str, Any]]:
        """Return the provider's keys as JSON Web Keys.

        Args:
            is_fresh: whether to update the cached keys, because a token has an unknown key.
                Even then, keys are requested at most once a minute.

        Raises:
            AccessError: the provider is unreachable, or its response is invalid.
        """
        metadata = await self.metadata()
        async with self._lock:
            age_s = self._clock() - self._keys_at
            if age_s >= (_OTHER_KEYS_S if is_fresh else KEPT_S):
                found = (await self._ask("GET", metadata.keys)).get("keys")
                if not isinstance(found, list):
                    raise AccessError(f"{metadata.keys}: expected a list of keys")
                self._keys = [each for each in found if isinstance(each, dict)]
                self._keys_at = self._clock()
            return self._keys

    async def redeem(self, code: str, verifier: str, redirect: str) -> dict[str, Any]:
        """Exchange a code for a token, and return the provider's response.

        Args:
            code: code from the browser's redirect.
            verifier: the secret of this sign-in (PKCE, RFC 7636).
            redirect: address to which the provider redirected the browser.

        Raises:
            AccessError: the provider is unreachable or rejects the code.
        """
        metadata = await self.metadata()
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": redirect,
            "code_verifier": verifier,
        }
        user, secret = self._options.client_id, self._options.client_secret
        credentials = None
        if not secret or metadata.is_secret_posted:
            form |= {"client_id": user} | ({"client_secret": secret} if secret else {})
        else:
            # Both parts are form-encoded before they are joined (RFC 6749, 2.3.1).
            credentials = httpx2.BasicAuth(quote(user, safe=""), quote(secret, safe=""))
        return await self._ask("POST", metadata.token, form=form, credentials=credentials)

    async def userinfo(self, token: str) -> dict[str, Any]:
        """Return further claims about a token's account; empty if the provider does not offer any.

        Raises:
            AccessError: the provider is unreachable or rejects the token.
        """
        metadata = await self.metadata()
        if not metadata.userinfo:
            return {}
        headers = {"authorization": f"Bearer {token}"}
        return await self._ask("GET", metadata.userinfo, headers=headers)

    async def _ask(
        self,
        method: str,
        url: str,
        *,
        form: Mapping[str, str] | None = None,
        headers: Mapping[str, str] | None = None,
        credentials: httpx2.BasicAuth | None = None,
    ) -> dict[str, Any]:
        """Send a request to the provider, and return the JSON object in the response."""
        if self._trust is None:
            # Run in a thread, because reading the certificate authorities takes tens of
            # milliseconds.
            self._trust = await asyncio.to_thread(self._trusted)
        # Request no compression, so that the response cannot grow after the transfer.
        sent = {"accept": "application/json", "accept-encoding": "identity", **(headers or {})}
        timeout = httpx2.Timeout(TOTAL_S, connect=_CONNECT_S)
        try:
            async with (
                asyncio.timeout(TOTAL_S),
                httpx2.AsyncClient(
                    verify=self._trust, timeout=timeout, follow_redirects=False
                ) as client,
                client.stream(method, url, headers=sent, data=form, auth=credentials) as response,
            ):
                body = await _read(url, response)
        except TimeoutError:
            raise AccessError(f"{url}: no complete response within {TOTAL_S:g} s") from None
        except (httpx2.HTTPError, httpx2.InvalidURL, OSError) as error:
            raise AccessError(f"{url}: {str(error) or type(error).__name__}") from None
        return _json(url, response.status_code, body)

    def _trusted(self) -> ssl.SSLContext:
        file = self._options.authority_file
        try:
            if file is None:
                return httpx2.create_ssl_context()
            return ssl.create_default_context(cafile=str(file))
        except (OSError, ssl.SSLError) as error:
            raise AccessError(f"{file}: expected certificates in PEM: {error}") from None


async def _read(url: str, response: httpx2.Response) -> bytes:
    if response.headers.get("content-encoding", "identity") != "identity":
        raise AccessError(f"{url}: the provider compressed its response without being asked")
    content = bytearray()
    async for piece in response.aiter_raw():
        content += piece
        if len(content) > MOST_BYTES:
            raise AccessError(f"{url}: the response has more than {MOST_BYTES} bytes")
    return bytes(content)


def _json(url: str, status: int, body: bytes) -> dict[str, Any]:
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        found = None
    if status != 200:
        # Show only the OAuth error code (RFC 6749, 5.2), because the description may be any text.
        reason = found.get("error") if isinstance(found, dict) else None
        shown = f": {reason}" if isinstance(reason, str) and reason.isidentifier() else ""
        raise AccessError(f"{url}: the provider replied with status {status}{shown[:80]}")
    if not isinstance(found, dict):
        raise AccessError(f"{url}: expected a JSON object")
    return found


def _parsed(found: Mapping[str, Any], issuer: str) -> ProviderMetadata:
    if found.get("issuer") != issuer:
        raise AccessError(
            f"the provider calls itself {str(found.get('issuer'))[:200]!r}; the options name"
            f" {issuer!r}"
        )
    is_private = httpx2.URL(issuer).scheme == "http"
    methods = found.get("token_endpoint_auth_methods_supported")
    return ProviderMetadata(
        _address(found, "authorization_endpoint", is_private=is_private),
        _address(found, "token_endpoint", is_private=is_private),
        _address(found, "jwks_uri", is_private=is_private),
        _address(found, "userinfo_endpoint", is_private=is_private)
        if "userinfo_endpoint" in found
        else "",
        isinstance(methods, list)
        and "client_secret_basic" not in methods
        and "client_secret_post" in methods,
    )


def _address(found: Mapping[str, Any], key: str, *, is_private: bool) -> str:
    """Return an address from the description; plain HTTP is valid only for a local HTTP issuer."""
    text = found.get(key)
    try:
        url = httpx2.URL(text if isinstance(text, str) else "")
    except httpx2.InvalidURL:
        url = httpx2.URL("")
    is_plain = url.scheme == "http" and is_private and is_loopback_host(url.host)
    if (url.scheme != "https" and not is_plain) or not url.host or url.fragment:
        raise AccessError(f"the provider's description has no valid {key}")
    return str(url)
