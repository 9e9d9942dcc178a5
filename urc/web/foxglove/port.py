"""A separate port for the Foxglove server, for viewers that expect an address without a path.

Layer 5. The port belongs to the dashboard's server, so the server's sign-in, certificates and
limits apply. Only the path differs: on this port, each WebSocket is a Foxglove client.
"""

from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from urc.web.serve.policy import REFUSAL_HEADERS
from urc.wire.foxglove import PATH

__all__ = ["FoxglovePort"]

_TEXT = "This port is for viewers that speak the Foxglove WebSocket protocol.\n"


class FoxglovePort:
    """An additional port of a server, with the middleware that recognises the port's requests."""

    def __init__(self, wanted: int) -> None:
        """Choose the port.

        Args:
            wanted: TCP port; 0 lets the system choose one.
        """
        self.wanted = wanted
        self.flag = "--foxglove"
        """Command-line option that sets the port, for error messages."""
        self.port = 0
        """The open port; 0 before the server listens."""

    def opened(self, port: int) -> None:
        """Store the TCP port on which the server really listens."""
        self.port = port

    def around(self, app: ASGIApp) -> ASGIApp:
        """Return an application that serves Foxglove on this port and `app` on all others."""

        async def serve(scope: Scope, receive: Receive, send: Send) -> None:
            if scope["type"] == "lifespan" or (scope.get("server") or ("", 0))[1] != self.port:
                await app(scope, receive, send)
            elif scope["type"] == "websocket":
                await app({**scope, "path": PATH, "raw_path": PATH.encode()}, receive, send)
            else:
                headers = {name.decode(): value.decode() for name, value in REFUSAL_HEADERS}
                headers |= {"upgrade": "websocket", "connection": "close"}
                await PlainTextResponse(_TEXT, 426, headers)(scope, receive, send)

        return serve
