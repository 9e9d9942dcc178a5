"""Sign-in with a provider: the flow, every way to cheat in it, and a provider that misbehaves.

The provider here is a web server on loopback, written from OpenID Connect Core and RFC 7636.
"""

import asyncio
import base64
import hashlib
import json
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest

from tests.authenticator import b64
from tests.unit.access.tokens import OTHER_RSA_KEY, RSA_KEY, jwk, sign
from urc.access import oidc_provider
from urc.access.external_accounts import ExternalAccount
from urc.access.grants import AccessError, Grant
from urc.access.oidc import STATE_S, OidcSignIn
from urc.access.oidc_options import ClaimRule, OidcOptions
from urc.access.oidc_provider import KEPT_S, MOST_BYTES, OidcProvider

pytestmark = pytest.mark.anyio

NOW = 1_000_000.0
REDIRECT = "https://robots.example/sign-in/oidc"
RULES = (ClaimRule("groups", "drivers", Grant("drive")),)


class FakeProvider:
    """A provider whose attributes change one detail of its answers."""

    def __init__(self) -> None:
        self.claims: dict[str, Any] = {
            "sub": "17",
            "preferred_username": "ann",
            "groups": ["drivers"],
        }
        self.more: dict[str, Any] = {"sub": "17"}
        self.response: dict[str, Any] = {}
        self.description: dict[str, Any] = {}
        self.key, self.keys = RSA_KEY, [jwk(RSA_KEY, kid="1")]
        self.key_id = "1"
        self.secret = "s3cret/ü"  # noqa: S105 - of a provider in this process
        self.answers: dict[str, Callable[[BaseHTTPRequestHandler], None]] = {}
        self.asked: list[str] = []
        self._codes: dict[str, dict[str, str]] = {}
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        self._thread = Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def visit(self, url: str) -> dict[str, str]:
        """Return the query with which the provider sends a browser back, after its sign-in."""
        query = {key: values[0] for key, values in parse_qs(urlsplit(url).query).items()}
        assert query["code_challenge_method"] == "S256"
        code = f"code{len(self._codes)}"
        self._codes[code] = query
        return {"code": code, "state": query["state"], "iss": self.url}

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        provider = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                provider.answer(self)

            do_POST = do_GET  # noqa: N815

            def log_message(self, *_: object) -> None:
                """Be quiet."""

        return Handler

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        path = request.path
        self.asked.append(path)
        if path in self.answers:
            self.answers[path](request)
            return
        match path:
            case "/.well-known/openid-configuration":
                found = {
                    "issuer": self.url,
                    "authorization_endpoint": f"{self.url}/authorize?tenant=lab",
                    "token_endpoint": f"{self.url}/token",
                    "jwks_uri": f"{self.url}/keys",
                    "userinfo_endpoint": f"{self.url}/userinfo",
                } | self.description
                send(request, found)
            case "/keys":
                send(request, {"keys": self.keys})
            case "/userinfo":
                assert request.headers["authorization"] == "Bearer access"
                send(request, self.more)
            case "/token":
                send(request, *self._token(request))

    def _token(self, request: BaseHTTPRequestHandler) -> tuple[dict[str, Any], int]:
        body = request.rfile.read(int(request.headers["content-length"])).decode()
        form = {key: values[0] for key, values in parse_qs(body).items()}
        basic = base64.b64encode(b"urc:s3cret%2F%C3%BC").decode()
        posted = form.get("client_id") == "urc" and form.get("client_secret") == self.secret
        if request.headers["authorization"] != f"Basic {basic}" and not posted:
            return {"error": "invalid_client", "error_description": "<script>"}, 401
        query = self._codes.pop(form["code"], None)
        challenge = b64(hashlib.sha256(form["code_verifier"].encode()).digest())
        if (
            query is None
            or form["redirect_uri"] != query["redirect_uri"]
            or challenge != query["code_challenge"]
        ):
            return {"error": "invalid_grant"}, 400
        times = {"iat": NOW, "exp": NOW + 300}
        claims = {"iss": self.url, "aud": "urc", "nonce": query["nonce"]} | times | self.claims
        token = sign(claims, key=self.key, kid=self.key_id)
        return {"id_token": token, "access_token": "access"} | self.response, 200


def send(request: BaseHTTPRequestHandler, found: object, status: int = 200, **headers: str) -> None:
    body = found if isinstance(found, bytes) else json.dumps(found).encode()
    request.send_response(status)
    for name, value in headers.items():
        request.send_header(name.replace("_", "-"), value)
    request.send_header("content-length", str(len(body)))
    request.end_headers()
    request.wfile.write(body)


@pytest.fixture
def provider() -> Iterator[FakeProvider]:
    made = FakeProvider()
    yield made
    made.close()


class House:
    """One server with its provider."""

    def __init__(self, provider: FakeProvider, **options: Any) -> None:
        self.time = 0.0
        self.provider = provider
        chosen: dict[str, Any] = {"client_secret": provider.secret, "rules": RULES} | options
        self.options = OidcOptions(provider.url, "urc", **chosen)
        ours = OidcProvider(self.options, lambda: self.time)
        self.sign_in = OidcSignIn(self.options, ours, lambda: self.time)

    async def account(self, **change: str) -> ExternalAccount:
        begun = await self.sign_in.begin(REDIRECT, "192.0.2.1")
        answer = self.provider.visit(begun.url) | change
        return await self.sign_in.finish(answer, begun.binding, NOW)


async def test_a_sign_in_returns_the_account(provider: FakeProvider) -> None:
    house = House(provider)
    begun = await house.sign_in.begin(REDIRECT, "192.0.2.1")
    assert begun.url.startswith(f"{provider.url}/authorize?tenant=lab&response_type=code&")
    query = parse_qs(urlsplit(begun.url).query)
    assert (query["redirect_uri"], query["scope"]) == ([REDIRECT], ["openid profile"])
    account = await house.sign_in.finish(provider.visit(begun.url), begun.binding, NOW)
    assert account == ExternalAccount(provider.url, "17", "ann", (Grant("drive"),), NOW + 43200)
    assert provider.asked == ["/.well-known/openid-configuration", "/token", "/keys"]
    await house.account()
    assert provider.asked[3:] == ["/token"], "the description and the keys are kept"


async def test_a_state_is_valid_once_and_for_a_time(provider: FakeProvider) -> None:
    house = House(provider)
    begun = await house.sign_in.begin(REDIRECT, "192.0.2.1")
    answer = provider.visit(begun.url)
    await house.sign_in.finish(answer, begun.binding, NOW)
    with pytest.raises(AccessError, match="took too long"):
        await house.sign_in.finish(answer, begun.binding, NOW)
    begun = await house.sign_in.begin(REDIRECT, "192.0.2.1")
    house.time = STATE_S
    with pytest.raises(AccessError, match="took too long"):
        await house.sign_in.finish(provider.visit(begun.url), begun.binding, NOW)


async def test_another_browser_cannot_finish_a_sign_in(provider: FakeProvider) -> None:
    """A link with the code of an attacker signs nobody in to the attacker's account."""
    house = House(provider)
    theirs = await house.sign_in.begin(REDIRECT, "192.0.2.1")
    mine = await house.sign_in.begin(REDIRECT, "192.0.2.1")
    for binding in (mine.binding, ""):
        with pytest.raises(AccessError, match="another browser"):
            await house.sign_in.finish(provider.visit(theirs.url), binding, NOW)
    assert "/token" not in provider.asked


async def test_a_refusal_of_the_provider_is_told(provider: FakeProvider) -> None:
    house = House(provider)
    with pytest.raises(AccessError, match="refused the sign-in: access_denied"):
        await house.account(error="access_denied")
    with pytest.raises(AccessError, match="refused the sign-in: no code"):
        await house.account(error="<script>", code="x")
    with pytest.raises(AccessError, match="different provider"):
        await house.account(iss="https://evil.example")
    with pytest.raises(AccessError, match="status 400: invalid_grant"):
        await house.account(code="guess")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nonce": "other"}, "for another sign-in"),
        ({"aud": "another"}, "for another server"),
        ({"iss": "https://evil.example"}, "a different issuer"),
        ({"exp": NOW - 100}, "check both clocks"),
        ({"sub": None}, "names no account"),
    ],
)
async def test_a_wrong_token_is_refused(
    provider: FakeProvider, change: dict[str, Any], message: str
) -> None:
    provider.claims |= change
    with pytest.raises(AccessError, match=message):
        await House(provider).account()


async def test_without_a_token_there_is_no_sign_in(provider: FakeProvider) -> None:
    provider.response = {"id_token": None}
    with pytest.raises(AccessError, match="sent no ID token"):
        await House(provider).account()


async def test_credentials_are_sent_as_the_provider_wants(provider: FakeProvider) -> None:
    provider.description = {"token_endpoint_auth_methods_supported": ["client_secret_post"]}
    assert (await House(provider).account()).subject == "17"
    provider.description = {}
    with pytest.raises(AccessError, match="status 401: invalid_client") as error:
        await House(provider, client_secret="wrong").account()  # noqa: S106 - see above
    assert "wrong" not in str(error.value)
    assert "script" not in str(error.value)


async def test_new_keys_are_fetched_at_most_once_a_minute(provider: FakeProvider) -> None:
    house = House(provider)
    await house.account()
    provider.key, provider.key_id = OTHER_RSA_KEY, "2"
    for _ in range(3):
        with pytest.raises(AccessError, match="unknown key"):
            await house.account()
    assert provider.asked.count("/keys") == 1
    house.time = 61.0
    provider.keys = [jwk(OTHER_RSA_KEY, kid="2")]
    assert (await house.account()).subject == "17"
    assert provider.asked.count("/keys") == 2
    house.time += KEPT_S
    await house.account()
    assert provider.asked.count("/.well-known/openid-configuration") == 2


async def test_claims_of_the_account_complete_the_token(provider: FakeProvider) -> None:
    del provider.claims["groups"]
    provider.more = {"sub": "17", "groups": ["drivers"], "preferred_username": "eve"}
    account = await House(provider).account()
    assert account.grants == (Grant("drive"),)
    assert account.name == "ann", "signed claims count more"
    provider.more["sub"] = "18"
    assert (await House(provider).account()).grants == ()


async def test_a_name_is_found_and_made_readable(provider: FakeProvider) -> None:
    provider.claims["preferred_username"] = " Ann \u202e\n\x07 Lee " + "x" * 100
    assert (await House(provider).account()).name == ("Ann Lee " + "x" * 100)[:64]
    provider.claims |= {"preferred_username": None, "email": "ann@example.org"}
    assert (await House(provider).account()).name == "ann@example.org"
    provider.claims["email"] = "\u202e"
    assert (await House(provider).account()).name == "17"


async def test_a_sign_in_ends_with_the_session_of_the_provider(provider: FakeProvider) -> None:
    assert (await House(provider, longest_s=60.0).account()).ends_at == NOW + 60
    provider.response = {"refresh_expires_in": 1800}
    assert (await House(provider).account()).ends_at == NOW + 1800
    provider.claims["session_expiry"] = NOW + 900
    assert (await House(provider).account()).ends_at == NOW + 900
    provider.response = {"refresh_expires_in": 0}
    provider.claims["session_expiry"] = NOW + 1e9
    assert (await House(provider).account()).ends_at == NOW + 43200


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"issuer": "https://evil.example"}, "calls itself 'https://evil.example'"),
        ({"token_endpoint": "http://192.0.2.1/token"}, "no valid token_endpoint"),
        ({"token_endpoint": None}, "no valid token_endpoint"),
        ({"jwks_uri": "file:///etc/passwd"}, "no valid jwks_uri"),
        ({"authorization_endpoint": "javascript:alert(1)"}, "no valid authorization_endpoint"),
        ({"userinfo_endpoint": 5}, "no valid userinfo_endpoint"),
    ],
)
async def test_a_bad_description_is_refused(
    provider: FakeProvider, change: dict[str, Any], message: str
) -> None:
    provider.description = change
    with pytest.raises(AccessError, match=message):
        await House(provider).account()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda request: send(request, b"{" * 100_000), "expected a JSON object"),
        (lambda request: send(request, b"[" * 100_000), "expected a JSON object"),
        (lambda request: send(request, b'"text"'), "expected a JSON object"),
        (lambda request: send(request, b" " * (MOST_BYTES + 1)), "more than 262144 bytes"),
        (lambda request: send(request, {}, 302, location="http://192.0.2.1/"), "status 302"),
        (lambda request: send(request, b"x", content_encoding="gzip"), "compressed"),
        (lambda request: send(request, {}, 500), "status 500"),
        (lambda request: request.connection.close(), "openid-configuration: "),
    ],
)
async def test_a_misbehaving_provider_is_reported(
    provider: FakeProvider, answer: Callable[[BaseHTTPRequestHandler], None], message: str
) -> None:
    provider.answers["/.well-known/openid-configuration"] = answer
    with pytest.raises(AccessError, match=message):
        await House(provider).account()


async def test_after_a_failure_the_provider_is_left_in_peace(provider: FakeProvider) -> None:
    path = "/.well-known/openid-configuration"
    provider.answers[path] = lambda request: send(request, {}, 503)
    house = House(provider)
    for _ in range(5):
        with pytest.raises(AccessError, match="status 503"):
            await house.sign_in.begin(REDIRECT, "192.0.2.1")
    assert provider.asked == [path]
    del provider.answers[path]
    house.time = 5.0
    await house.account()


async def test_a_silent_provider_never_holds_up_the_loop(
    provider: FakeProvider, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(oidc_provider, "TOTAL_S", 0.5)
    path = "/.well-known/openid-configuration"
    provider.answers[path] = lambda _: time.sleep(1.5)
    house = House(provider)
    gaps: list[float] = []

    async def beat() -> None:
        last = time.perf_counter()
        while True:
            await asyncio.sleep(0.01)
            gaps.append(time.perf_counter() - last)
            last = time.perf_counter()

    async with asyncio.TaskGroup() as group:
        beating = group.create_task(beat())
        begun = time.perf_counter()
        with pytest.raises(AccessError, match=r"no complete response within 0\.5 s"):
            await house.sign_in.begin(REDIRECT, "192.0.2.1")
        assert time.perf_counter() - begun < 1.4
        beating.cancel()
    assert max(gaps) < 0.25, "generous, because other tests share the processor"


async def test_an_unreachable_provider_is_reported() -> None:
    options = OidcOptions("http://127.0.0.1:9", "urc", rules=RULES)
    with pytest.raises(AccessError, match=r"127\.0\.0\.1:9/\.well-known"):
        await OidcSignIn(options).begin(REDIRECT, "192.0.2.1")


async def test_a_wrong_file_of_authorities_is_reported(
    provider: FakeProvider, tmp_path: Any
) -> None:
    file = tmp_path / "ca.pem"
    file.write_text("no certificate")
    with pytest.raises(AccessError, match="expected certificates in PEM"):
        await House(provider, authority_file=file).account()
