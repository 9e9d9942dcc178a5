"""Routes for the pages' files: modules, styles, widgets, catalogues and map tiles.

Layer 5. Each request is looked up in a table; see `urc.web.load.assets`.
"""

from collections.abc import Callable
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from urc.web import words
from urc.web.load.assets import STATIC, Assets, folder_assets, script
from urc.web.load.files import tile
from urc.web.serve.rights import ANYONE, SIGNED_IN, ProtectedRoute

__all__ = ["FileRoutes"]


class FileRoutes:
    """The routes for the pages' files.

    Args:
        vendor: folder with the build's third-party modules; None if there is no build.
        tiles: folder with map tiles, ``z/x/y.png``; None if the server has no tiles.
        widgets: function that returns the tables of widget files. The first table that contains a
            file takes precedence.
    """

    def __init__(
        self, vendor: Path | None, tiles: Path | None, widgets: Callable[[], tuple[Assets, ...]]
    ) -> None:
        self._static = folder_assets(STATIC)
        self._vendor = folder_assets(vendor) if vendor else Assets()
        self._tiles = tiles
        self._widgets = widgets

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes, which must follow the routes for the widget pages."""
        return [
            ProtectedRoute("/favicon.ico", self._favicon, ANYONE),
            ProtectedRoute("/app.webmanifest", self._manifest, ANYONE),
            ProtectedRoute("/sw.js", self._worker, ANYONE),
            ProtectedRoute("/words/{tag}.js", self._words, ANYONE),
            ProtectedRoute("/static/{file:path}", self._static_file, ANYONE),
            ProtectedRoute("/vendor/{file:path}", self._vendor_file, ANYONE),
            ProtectedRoute("/widgets/{file:path}", self._widget_file, SIGNED_IN),
            ProtectedRoute("/tiles/{z:int}/{x:int}/{y:int}.{kind}", self._tile, SIGNED_IN),
        ]

    def has_widget(self, name: str) -> bool:
        """Return whether a widget with this name has any files."""
        return any(f"{name}/widget.js" in table.files for table in self._widgets())

    async def _favicon(self, request: Request) -> Response:
        return self._static.respond("favicon.svg", request)

    async def _manifest(self, request: Request) -> Response:
        return self._static.respond("app.webmanifest", request)

    async def _worker(self, request: Request) -> Response:
        """Serve the service worker from the root URL, so that it covers all pages."""
        return self._static.respond("sw.js", request)

    async def _words(self, request: Request) -> Response:
        """Serve the catalogue for one language as a JavaScript module."""
        tag = request.path_params["tag"]
        if tag not in words.LANGUAGES:
            raise HTTPException(404)
        return script(words.module(tag), request)

    async def _static_file(self, request: Request) -> Response:
        return self._static.respond(request.path_params["file"], request)

    async def _vendor_file(self, request: Request) -> Response:
        return self._vendor.respond(request.path_params["file"], request)

    async def _widget_file(self, request: Request) -> Response:
        file = request.path_params["file"]
        tables = self._widgets()
        table = next((one for one in tables if file in one.files), tables[-1])
        answer = table.respond(file, request)
        request.state.is_file = True
        return answer

    async def _tile(self, request: Request) -> Response:
        """Serve a map tile; respond with status 404 if no tile folder is configured."""
        if self._tiles is None:
            raise HTTPException(404)
        return tile(self._tiles, **request.path_params, request=request)
