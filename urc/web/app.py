"""The dashboard as one ASGI application: routes to pages, files and sockets.

Layer 5. The module only combines the other modules. `build_app` takes the robots and all options;
`serve` runs the application.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Collection, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final
from urllib.parse import quote

import msgspec
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from urc import __version__
from urc.model.profile import Profile
from urc.problems import UrcError
from urc.runtime.alarm_store import AlarmStore
from urc.runtime.alarm_table import FILE as ALARM_FILE
from urc.runtime.audit import FILE as AUDIT_FILE
from urc.runtime.audit import AuditLog
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.one_shot_commands import can_move
from urc.runtime.redaction import secret_texts
from urc.runtime.server_recorder import ServerRecorder
from urc.shipped import vendored
from urc.web import words
from urc.web.access_page import AccessMiddleware
from urc.web.alarms.notifier import AlarmNotifier
from urc.web.alarms.routes import AlarmCalls
from urc.web.api.calls import api_routes
from urc.web.api.group_calls import FarCommands, GroupCalls
from urc.web.api.recordings import RecordingCalls
from urc.web.api.robots import RobotCalls
from urc.web.api.stop_calls import FarRobots, StopCalls
from urc.web.api_document import DOCUMENT, document
from urc.web.audit.routes import AuditRoutes
from urc.web.dev.routes import Dev, dev_url, no_dev_routes
from urc.web.dev.start import DevStart, no_dev_start
from urc.web.dev.watch import Remake
from urc.web.drive.redundant_socket import RedundantSocket
from urc.web.error_handlers import ERROR_HANDLERS
from urc.web.fleet.contact_watch import ContactWatch
from urc.web.fleet.fleet import Fleet
from urc.web.fleet.robot_factory import RobotFactory, RobotOptions
from urc.web.fleet.robots import LINGER_S, Playback, Robot, RobotService, missing_settings
from urc.web.foxglove.socket import FoxgloveServer, TokenInAddress
from urc.web.load.assets import Assets, import_map
from urc.web.load.file_routes import FileRoutes
from urc.web.load.widget_trust import WidgetTrust
from urc.web.manage.manager import Manager
from urc.web.manage.new_robot import NewRobotRoutes
from urc.web.manage.playback_control import move_playback, playback_state
from urc.web.manage.routes import ManageRoutes
from urc.web.manage.settings_routes import SettingsRoutes
from urc.web.metrics.metric_names import ReadingChoice
from urc.web.metrics.routes import MetricRoutes
from urc.web.page_socket import BrowserClient
from urc.web.people.people_routes import PeopleRoutes
from urc.web.people.proxy_middleware import ProxyMiddleware
from urc.web.people.sign_in_page import Stoppable
from urc.web.people.ways_in import SignInOptions, WaysIn
from urc.web.picture_socket import PictureSocket
from urc.web.robot_services import Stores, fleet_of, latch_of
from urc.web.serve.access import Access
from urc.web.serve.actors import record_admission, record_bad_token
from urc.web.serve.certificates import Certificates
from urc.web.serve.policy import Policy
from urc.web.serve.replies import Endpoint, told
from urc.web.serve.rights import (
    DRIVE,
    LOCAL,
    MAINTAIN_SERVER,
    SIGNED_IN,
    WATCH,
    ProtectedRoute,
    ProtectedSocket,
)
from urc.web.serve.server import serve
from urc.web.serve.visitor import peer_of, visitor_of
from urc.web.show.card import Cards
from urc.web.show.external_pages import ExternalPages
from urc.web.show.frame_document import FrameDocuments
from urc.web.show.gallery import Gallery
from urc.web.show.interfaces import KEPT, chosen
from urc.web.show.menu import NavigationLinks, menu_page
from urc.web.show.pages import PageHead, RobotPageRequest, ServerParts, robot_page
from urc.web.show.trust import TrustPages
from urc.web.sites.far_commands import FarCommandCalls
from urc.web.sites.far_stops import FarStops
from urc.web.sites.robot_names import far_name
from urc.web.sites.site_network import SiteNetwork
from urc.web.sites.site_routes import SiteRoutes
from urc.web.sites.stop_routes import StopRoutes
from urc.web.wire import messages as wire

__all__ = ["DashboardOptions", "Robot", "build_app", "serve"]

_PAGE = {"cache-control": "no-store"}
_LATE_S = 2.0
"""Interval between audit entries with counts of repeated events, in seconds."""
_Part = AuditRoutes | ManageRoutes | SettingsRoutes | NewRobotRoutes | DevStart
_NO_ROBOT = "this server has no robot with that name"


@dataclass(frozen=True, slots=True)
class DashboardOptions:
    """Options of the application. By default, the server stores nothing and shows no start key."""

    access: Access | None = None
    """Identities and rights of the server; None creates a start key that is never shown."""
    allowed_hosts: Collection[str] = ()
    """Accepted host names in addition to addresses, ``localhost`` and the server's own names."""
    linger_s: float = LINGER_S
    """Time for which a robot stays connected after its last client has left, in seconds."""
    data: Path | None = None
    """Folder for the latches and the audit log; None to store neither."""
    audit: AuditLog | None = None
    """The folder's audit log, already open; the application closes the log at its end. With None,
    the application opens the log."""
    tiles: Path | None = None
    """Folder with map tiles, ``z/x/y.png``; None if the server has no tiles."""
    remake: Mapping[str, Remake] | None = None
    """Functions that create a robot from its saved document; None for a server without developer
    pages."""
    robot_options: RobotOptions | None = None
    """Options of the robot factory; None if the server has neither manager pages nor settings
    pages."""
    trusted: Collection[str] = ()
    """Names of third-party widgets that run in the page instead of a frame."""
    recordings: Path | None = None
    """Recordings folder; None disables recordings."""
    certificates: Certificates | None = None
    """Certificates for HTTPS; None for plain HTTP."""
    sign_in: SignInOptions = field(default_factory=SignInOptions)
    """Options of the sign-in methods."""
    notifier: AlarmNotifier | None = None
    """Receiver of all robots' new alarms, which sends notifications; None to send none."""
    network: SiteNetwork | None = None
    """The fleet of this server; None for a server alone."""
    metrics: Sequence[ReadingChoice] = ()
    """Readings that ``/metrics`` contains."""


_DEFAULT: Final = DashboardOptions()


def build_app(robots: Mapping[str, Robot], options: DashboardOptions = _DEFAULT) -> Starlette:
    """Return the application that serves `robots`, which are keyed by their names in URLs.

    Raises:
        UrcError: two robots use different widgets with the same name, or an extra that a sign-in
            method needs is not installed.
    """
    access, data, notifier = options.access or Access(), options.data, options.notifier
    audit = options.audit
    if audit is None and data is not None:
        audit = AuditLog(data / AUDIT_FILE)
    recorder = ServerRecorder(audit.add if audit else _unread, secrets=[access.key])
    alarms = AlarmStore(data / ALARM_FILE) if data is not None else None
    fleet = fleet_of(robots, Stores(data, audit, alarms, notifier), options.linger_s)
    contacts = ContactWatch(lambda: fleet.services, data)
    routes = _Routes(
        fleet=fleet,
        modules=import_map(vendored()),
        ways=NavigationLinks(
            has_managers=options.robot_options is not None,
            has_new=options.robot_options is not None and options.robot_options.shows_installed,
            has_dev=options.remake is not None,
            has_audit=audit is not None,
        ),
        access=access,
        recording_calls=RecordingCalls(lambda: fleet.services, options.recordings, recorder),
        robot_calls=RobotCalls(lambda: fleet.services, access.followed, contacts.times),
        stop_calls=StopCalls(lambda: fleet.services, recorder),
        contacts=contacts,
        alarm_calls=AlarmCalls(lambda: fleet.services, alarms, recorder, notifier),
        alarms=alarms,
        notifier=notifier,
        audit=audit,
        recorder=recorder,
        ways_in=WaysIn(access, recorder, options.sign_in),
        data=data,
        trust=WidgetTrust.of(options.trusted),
        network=options.network,
        metrics=_metrics(fleet, options),
    )
    if options.network is not None:
        options.network.attach(access, recorder)
        routes.add_sites(options.network)
    access.tags_of = routes.tags_of
    access.on_admit = partial(record_admission, recorder)
    access.on_bad_token = partial(record_bad_token, recorder)
    routes.add_managers(options)
    return _Dashboard(routes, options)


def _metrics(fleet: Fleet, options: DashboardOptions) -> MetricRoutes:
    network = options.network
    site, sites = (network.site, network.watch.presence) if network is not None else ("", dict)
    return MetricRoutes(lambda: fleet.services, site, sites, options.metrics, __version__)


def _unread(entry: AuditEntry) -> None:
    """Ignore the entry."""


class _Dashboard(Starlette):
    """A Starlette application with the page policy on all responses, including errors."""

    def __init__(self, routes: "_Routes", options: DashboardOptions) -> None:
        self._access = access = routes.access
        self._ways_in = routes.ways_in
        self._network = network = routes.network
        version = network.version if network is not None else __version__
        self._people = people = routes.people_routes()
        self._allowed_hosts = frozenset(options.allowed_hosts)
        dev = routes.dev
        files = FileRoutes(vendored(), options.tiles, routes.widget_files)
        gallery = routes.gallery = Gallery(
            routes.modules,
            routes.profiles,
            is_dev=dev is not None,
            trust=routes.trust,
            ways=routes.ways,
        )
        frames = FrameDocuments(routes.modules, files.has_widget, access.frame_code)
        parts = routes.with_calls()
        endpoints = routes.endpoints() | people.endpoints()
        for part in parts:
            endpoints |= part.endpoints()
        super().__init__(
            routes=[
                ProtectedRoute("/", routes.menu, SIGNED_IN),
                ProtectedRoute("/robots/{name}/", routes.robot, WATCH),
                *Cards(lambda: routes.services).routes(),
                ProtectedRoute(DOCUMENT, document, SIGNED_IN),
                *api_routes(endpoints),
                *(route for one in parts for route in one.routes()),
                *routes.ways_in.routes(),
                *people.routes(),
                *gallery.routes(),
                *files.routes(),
                *TrustPages(options.certificates).routes(),
                *(routes.network.routes() if routes.network is not None else ()),
                *SiteRoutes(lambda: routes.services, routes.contacts.times, version).routes(),
                *routes.metrics.routes(),
                *StopRoutes(routes.stop_calls.local).routes(),
                ProtectedRoute("/frames/{widget}", frames.frame, SIGNED_IN),
                *ExternalPages(lambda: routes.robots).routes(),
                ProtectedSocket("/ws", routes.socket, SIGNED_IN),
                ProtectedSocket("/ws/spare", routes.spare, SIGNED_IN),
                ProtectedSocket("/ws/pictures", routes.pictures, SIGNED_IN),
                *routes.foxglove().routes(),
                *(dev.routes() if dev else no_dev_routes()),
                *(() if routes.dev_start else no_dev_start()),
            ],
            exception_handlers=ERROR_HANDLERS,
            lifespan=routes.lifespan,
        )

    def build_middleware_stack(self) -> ASGIApp:
        """Wrap the application and its error handlers in the page policy."""
        inner = super().build_middleware_stack()
        if self._network is not None:
            inner = self._network.around(inner, self._access)
        door = AccessMiddleware(inner, self._access, self.routes, self._people.pages)
        policy = Policy(
            words.LanguageMiddleware(door), self._access, allowed_hosts=self._allowed_hosts
        )
        proxied = ProxyMiddleware(policy, self._ways_in.sign_ins, self._ways_in.options.proxies)
        return TokenInAddress(proxied)


@dataclass(slots=True)
class _Routes:
    fleet: Fleet
    modules: Mapping[str, object]
    ways: NavigationLinks
    access: Access
    recorder: ServerRecorder
    recording_calls: RecordingCalls
    robot_calls: RobotCalls
    stop_calls: StopCalls
    contacts: ContactWatch
    alarm_calls: AlarmCalls
    ways_in: WaysIn
    metrics: MetricRoutes
    alarms: AlarmStore | None = None
    notifier: AlarmNotifier | None = None
    audit: AuditLog | None = None
    data: Path | None = None
    trust: WidgetTrust = field(default_factory=WidgetTrust)
    manager: Manager | None = None
    dev: Dev | None = None
    dev_start: DevStart | None = None
    network: SiteNetwork | None = None
    gallery: Gallery = field(init=False)
    group_calls: GroupCalls = field(init=False)

    def __post_init__(self) -> None:
        self.group_calls = GroupCalls(lambda: self.services, self.robot_calls)

    @property
    def robots(self) -> Mapping[str, Robot]:
        """All served robots, keyed by their names in URLs."""
        return self.fleet.robots

    @property
    def services(self) -> Mapping[str, RobotService]:
        """The robots' services, keyed by the robots' names in URLs."""
        return self.fleet.services

    def add_managers(self, options: DashboardOptions) -> None:
        """Add the managers and developer pages that the options enable."""
        if options.robot_options is not None:
            factory = RobotFactory(options.robot_options)
            self.manager = Manager(factory, self.fleet, time.monotonic, self.renew)
        if options.remake is not None:
            self.dev = Dev(self.fleet.services, options.remake, self.renew)
            self.dev_start = DevStart(self.fleet, options.remake, self.renew, self.ways)

    def add_sites(self, network: SiteNetwork) -> None:
        """Add the robots of other sites."""
        sites = network.client
        far = FarStops(network.stops, network.watch, lambda: sites.sites, self.recorder)
        self.robot_calls.far = network.watch.summaries
        self.robot_calls.sites = network.watch.states
        self.stop_calls.far = FarRobots(network.watch.summaries, far.stop)
        runs = FarCommandCalls(network.client, network.watch, network.proofs)
        self.group_calls.far = FarCommands(network.watch.summaries, runs.commands, runs.run)

    def with_calls(self) -> "list[_Part]":
        """Return the objects that provide both pages and API calls."""
        found: list[_Part] = [
            AuditRoutes(self.audit, self.recorder, lambda: self.services, self.ways)
        ]
        if self.manager is not None:
            found.append(ManageRoutes(self.manager, self.ways, self.recorder))
            found.append(SettingsRoutes(self.manager, self.ways, self.recorder))
            found.append(NewRobotRoutes(self.manager, self.ways, self.recorder))
        if self.dev_start is not None:
            found.append(self.dev_start)
        return found

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the API endpoints of every server, keyed by call name."""
        return {
            "health": self.health,
            "controls": self.controls,
            "playback": self.recording,
            "playback_move": self.move,
            **self.robot_calls.endpoints(),
            **self.stop_calls.endpoints(),
            **self.group_calls.endpoints(),
            **self.alarm_calls.endpoints(),
            **self.recording_calls.endpoints(),
        }

    def people_routes(self) -> PeopleRoutes:
        """Return the routes for people, devices and sign-ins."""
        return PeopleRoutes(
            self.ways_in,
            stoppable=self.stoppable,
            robots=self.titles,
            tags_of=self.tags_of,
            ways=self.ways,
            data=self.data,
        )

    def foxglove(self) -> FoxgloveServer:
        """Return the server for programs that speak the Foxglove protocol."""
        run, followed = self.robot_calls.run, self.access.followed
        return FoxgloveServer(lambda: self.services, run, followed, self.recorder)

    def stoppable(self) -> list[Stoppable]:
        """Return all robots that can move, for the STOP buttons of the sign-in page."""
        return [
            Stoppable(name, each.profile.title or name)
            for name, each in self.robots.items()
            if each.playback is None and can_move(each.profile.driver)
        ]

    def titles(self) -> dict[str, str]:
        """Return the titles of all robots, keyed by their names in URLs."""
        return {name: each.profile.title or name for name, each in self.robots.items()}

    def tags_of(self, name: str) -> tuple[str, ...]:
        """Return the tags of a robot; () for an unknown robot."""
        robot = self.robots.get(name)
        return robot.profile.tags if robot is not None else ()

    def profiles(self) -> list[Profile]:
        """Return the profiles of the served robots."""
        return [each.profile for each in self.robots.values()]

    def widget_files(self) -> tuple[Assets, ...]:
        """Return the robots' widget files, followed by the gallery's widget files."""
        return self.fleet.widgets, self.gallery.assets

    def renew(self, name: str, robot: Robot) -> None:
        """Switch to another version of a robot; raise `UrcError` if widget names conflict."""
        latch = latch_of(self.data, robot)
        robot = self.fleet.renew(name, robot)
        secrets = secret_texts(robot.profile, robot.settings)
        self.services[name].controls.recorder.hide(secrets)
        self.services[name].replace(robot, latch)
        self.access.recheck()  # the new document may lack a tag with grants

    @asynccontextmanager
    async def lifespan(self, _: Starlette) -> AsyncIterator[None]:
        """Run one session supervisor for each robot until the server ends."""
        try:
            async with AsyncExitStack() as stack, self.fleet.running() as group:
                if self.manager is not None:
                    await self.manager.changed()
                self.recorder.server("started", __version__)
                if self.network is not None:
                    await stack.enter_async_context(self.network.running())
                tasks = [
                    group.create_task(self.access.run()),
                    group.create_task(self._record_late()),
                    group.create_task(self.contacts.run()),
                ]
                if self.dev:
                    tasks.append(group.create_task(self.dev.run()))
                if self.manager is not None:
                    tasks.append(group.create_task(self.manager.watch_blocks()))
                yield
                self.robot_calls.sessions.close()
                await self.recording_calls.close()
                await self.contacts.close()
                self.metrics.close()
                for task in tasks:
                    task.cancel()
                if self.manager is not None:
                    await self.manager.close()
        finally:
            self.recorder.server("ended", __version__)
            if self.notifier is not None:
                await asyncio.to_thread(self.notifier.close)
            if self.alarms is not None:
                await asyncio.to_thread(self.alarms.close)
            if self.audit:  # closed last: it records the stops at the end
                await asyncio.to_thread(self.audit.close)

    async def _record_late(self) -> None:
        """Write clock jumps and counts of repeated events to the audit log until cancelled."""
        while True:
            await asyncio.sleep(_LATE_S)
            self.recorder.flush()
            self.recorder.check_clock()

    async def menu(self, request: Request) -> Response:
        head = PageHead(request.state.nonce, "URC")
        drivers: Mapping[str, str] = {}
        if self.manager is not None:
            await self.manager.refresh()
            drivers = self.manager.drivers()
        visitor = visitor_of(request)
        states = self.robot_calls.listed(visitor)
        html = menu_page(
            head,
            {one.name: self.robots[one.name] for one in states.robots if one.name in self.robots},
            far=[one for one in states.robots if far_name(one.name) is not None],
            states=msgspec.to_builtins(states),
            ways=self.ways,
            drivers=drivers,
            broken=self.fleet.broken if visitor.may(MAINTAIN_SERVER) else {},
            stoppable=sum(one.can_stop for one in states.robots),
        )
        return HTMLResponse(html, headers=_PAGE)

    async def robot(self, request: Request) -> Response:
        name = request.path_params["name"]
        robot = self.robots.get(name) or await self._far_robot(name)
        if robot is None:
            raise HTTPException(
                404, words.t("This server has no robot called “{name}”.", name=name)
            )
        is_far = name not in self.robots
        if missing_settings(robot) and not is_far:
            settings = f"/robots/{quote(name, safe='')}/settings"
            place = settings if self.ways.has_managers else "/"
            return RedirectResponse(place, status_code=303)
        query = request.query_params
        kept = request.cookies.get(KEPT, "")
        dark = frozenset() if is_far else self.fleet.dark_videos(name)
        interface = chosen(robot.profile, query.get("interface"), kept, dark=dark)
        if interface is None:
            raise HTTPException(404, words.t("This robot has no interface with that name."))
        visitor = visitor_of(request)
        is_dev = self.dev is not None and visitor.may(LOCAL) and not is_far
        asked = RobotPageRequest(
            request.state.nonce,
            tab=query.get("tab", ""),
            is_watching="watch" in query,
            is_part="part" in query,
            may_act=visitor.may(DRIVE, name),
            dev_url=dev_url(name) if is_dev else "",
        )
        has_settings = self.ways.has_managers and not is_far
        shared = ServerParts(self.modules, self.trust, has_settings)
        html = await asyncio.to_thread(robot_page, name, robot, interface, shared, asked)
        return HTMLResponse(html, headers=_PAGE)

    async def _far_robot(self, name: str) -> Robot | None:
        """Return a robot of another site, made from its document; None if the name has no site.

        Raises:
            HTTPException: the site cannot be reached, or does not know the robot.
        """
        far = far_name(name)
        if far is None or self.network is None:
            return None
        try:
            return self.fleet.shown(name, await self.network.watch.robot(far))
        except UrcError as fault:
            raise HTTPException(502, str(fault)) from fault

    async def health(self, _: Request) -> Response:
        return JSONResponse({"status": "ok", "version": __version__}, headers=_PAGE)

    async def controls(self, request: Request) -> Response:
        """Return a robot's lease and the state of its STOP."""
        service = self.services.get(request.path_params["name"])
        if service is None:
            return told(404, _NO_ROBOT, "unknown-robot")
        return JSONResponse(service.control_state(), headers=_PAGE)

    async def recording(self, request: Request) -> Response:
        """Return the state of a playback."""
        return playback_state(self._playback(request))

    async def move(self, request: Request) -> Response:
        """Play, pause or seek a playback."""
        return await move_playback(request, self._playback(request))

    def _playback(self, request: Request) -> Playback | None:
        robot = self.robots.get(request.path_params["name"])
        return robot.playback if robot is not None else None

    async def socket(self, websocket: WebSocket) -> None:
        name, service = await self._accepted(websocket)
        if service is not None:
            flow = websocket.scope["state"]["flow"]
            is_recorded = service.robot.playback is not None
            peer = peer_of(websocket, name, only_watches=is_recorded)
            client = BrowserClient(websocket, service, flow, peer)
            with self.access.followed(client.recheck):
                await client.serve()

    async def spare(self, websocket: WebSocket) -> None:
        """Serve the redundant socket of a page in control."""
        _, service = await self._accepted(websocket)
        if service is not None:
            flow = websocket.scope["state"]["flow"]
            await RedundantSocket(websocket, service.controls, service.clock, flow).serve()

    async def pictures(self, websocket: WebSocket) -> None:
        """Serve the socket for a page's images."""
        _, service = await self._accepted(websocket)
        if service is not None:
            flow = websocket.scope["state"]["flow"]
            await PictureSocket(websocket, service.picture_pages, service.clock, flow).serve()

    async def _accepted(self, websocket: WebSocket) -> tuple[str, RobotService | None]:
        """Accept a page's socket; return its robot's name and service, or close the socket."""
        await websocket.accept()
        names = list(self.services)
        name = websocket.query_params.get("robot", names[0] if len(names) == 1 else "")
        service = self.services.get(name)
        if not visitor_of(websocket).may(WATCH, name):
            await websocket.close(wire.CLOSE_NOT_LET_IN, WATCH.refusal)
            return name, None
        if service is None:
            await websocket.close(wire.CLOSE_NO_ROBOT, "this server has no robot with that name")
        return name, service
