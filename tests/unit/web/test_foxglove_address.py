"""The token in the address of a viewer: it replaces the header, and only on the viewers' path."""

from collections.abc import Sequence

import pytest
from starlette.types import Message, Receive, Scope, Send

from urc.model.role import Role
from urc.web.foxglove.port import FoxglovePort
from urc.web.foxglove.socket import TokenInAddress
from urc.web.serve.access import Access
from urc.web.serve.policy import Policy
from urc.wire.foxglove import PATH

pytestmark = pytest.mark.anyio

KEY = "the-start-key"
FOREIGN = ("origin", "https://viewer.example")
PORT = 8765


class Asked:
    """A handshake, and what the application saw of it."""

    def __init__(self, *, anonymous: Role | None = None) -> None:
        self.access = Access(key=KEY, anonymous=anonymous)
        self.seen: Scope | None = None

    async def inner(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.seen = scope
        await send({"type": "websocket.accept"})

    async def ask(
        self,
        query: str,
        *headers: tuple[str, str],
        path: str = PATH,
        server: tuple[str, int] = ("127.0.0.1", 8080),
    ) -> int:
        """Return 101 for an upgrade that the application accepts; otherwise the status."""
        host = ("host", "127.0.0.1:8080")
        scope: Scope = {
            "type": "websocket",
            "scheme": "ws",
            "path": path,
            "raw_path": path.encode(),
            "query_string": query.encode(),
            "client": ("127.0.0.1", 50_000),
            "server": server,
            "headers": [(name.encode(), value.encode()) for name, value in (host, *headers)],
            "extensions": {"websocket.http.response": {}},
            "state": {},
        }
        sent: list[Message] = []

        async def receive() -> Message:
            return {"type": "websocket.connect"}

        async def send(message: Message) -> None:
            sent.append(message)

        port = FoxglovePort(PORT)
        port.opened(PORT)
        app = port.around(TokenInAddress(Policy(self.inner, self.access)))
        await app(scope, receive, send)
        return 101 if sent[0]["type"] == "websocket.accept" else int(sent[0]["status"])


@pytest.mark.parametrize("headers", [(), (FOREIGN,), (("origin", "null"),)])
async def test_a_valid_token_identifies_a_viewer_of_any_site(
    headers: Sequence[tuple[str, str]],
) -> None:
    asked = Asked()
    assert await asked.ask(f"watch=1&token={KEY}", *headers) == 101
    assert asked.seen is not None
    assert asked.seen["state"]["visitor"].is_local
    assert asked.seen["query_string"] == b"watch=1", "the token goes no further"


@pytest.mark.parametrize("anonymous", [None, "drive"])
@pytest.mark.parametrize("query", ["", "token=", "token=guessed", f"key={KEY}"])
async def test_without_a_valid_token_no_other_site_opens_a_socket(
    query: str, anonymous: Role | None
) -> None:
    """Not even on a server without a sign-in: its owner's browser may show any page."""
    asked = Asked(anonymous=anonymous)
    assert await asked.ask(query, FOREIGN) == 403
    assert asked.seen is None


async def test_a_cookie_adds_nothing_to_a_token() -> None:
    """The browser adds cookies by itself, so the page of another site would act as its owner."""
    asked = Asked()
    cookie = ("cookie", f"{asked.access.cookie}={asked.access.admit(KEY)}")
    assert await asked.ask("token=guessed", cookie, FOREIGN) == 403
    assert await asked.ask("token=guessed", cookie) == 101
    assert asked.seen is not None
    assert not asked.seen["state"]["visitor"].is_known


async def test_other_sockets_accept_no_token_in_their_address() -> None:
    asked = Asked()
    assert await asked.ask(f"token={KEY}", path="/ws") == 403
    assert await asked.ask(f"token={KEY}", FOREIGN, path="/ws") == 403


async def test_on_the_port_for_viewers_every_path_is_that_of_viewers() -> None:
    asked = Asked()
    near = ("127.0.0.1", PORT)
    assert await asked.ask(f"token={KEY}", FOREIGN, path="/", server=near) == 101
    assert asked.seen is not None
    assert asked.seen["path"] == PATH
    assert await asked.ask("", path="/ws", server=near) == 403
