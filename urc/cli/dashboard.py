"""Functions that start a dashboard for profiles, shared by `urc serve` and `urc demo`."""

import asyncio
import gc
import time
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from starlette.types import ASGIApp

from urc.cli.data_folder import own_folder
from urc.cli.error_report import Misuse
from urc.cli.event_loop import run_loop
from urc.cli.fault_injection import FaultInjector
from urc.cli.output import complain
from urc.cli.rendering import warn_without_rendering
from urc.cli.start_addresses import ReadyDashboard, access_for, announce, ready_addresses
from urc.cli.tls_options import PLAIN, TlsOptions, certificates_of
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.runtime.audit import FILE, AuditLog
from urc.runtime.data_restore import is_interrupted
from urc.runtime.document_tests import sample_settings
from urc.runtime.missing_packages import MissingPackages, missing_packages
from urc.runtime.registries import built_in_catalog
from urc.runtime.server_recorder import NO_ACTOR, ServerRecorder
from urc.runtime.session import Motion, Session
from urc.runtime.settings_store import StoredSettings
from urc.simulator.emulated_profile import stand_in
from urc.simulator.emulated_robot import EmulatedRobot
from urc.web.alarms.notifier import AlarmNotifier
from urc.web.alarms.notify_options import NotifyOptions
from urc.web.app import DashboardOptions, Robot, build_app, serve
from urc.web.fleet.robot_factory import RobotFactory, RobotOptions
from urc.web.fleet.robots import Glimpse
from urc.web.foxglove.port import FoxglovePort
from urc.web.metrics.metric_names import ReadingChoice, is_numeric
from urc.web.people.ways_in import SignInOptions
from urc.web.serve.access import Access
from urc.web.serve.clock_check import clock_warning
from urc.web.serve.service_manager import ServiceManager, answers
from urc.web.sites.site_network import SiteNetwork

__all__ = ["DashboardAddress", "SettingsOf", "robot_options_of", "run_dashboard"]

SettingsOf = Callable[[Profile], Mapping[str, Value]]
"""Function that returns the settings of a profile from the command line.

The function raises `UrcError` if the settings are invalid.
"""
_LOOK = (320, 240)
"""Width and height of the top view on an emulated robot's card, in pixels."""


def _nothing(_: Profile) -> Mapping[str, Value]:
    """Return no settings."""
    return {}


@dataclass(frozen=True, slots=True)
class DashboardAddress:
    """Address, folders and options of the dashboard."""

    host: str
    port: int
    allowed_hosts: Sequence[str] = ()
    data: Path | None = None
    """URC's data folder; None means this user's default data folder."""
    has_guard: bool = True
    """Whether to start a guard process, which stops motion if this process fails."""
    tiles: Path | None = None
    """Folder of map tiles; None means maps without background tiles."""
    is_open: bool = False
    """Whether visitors who have not signed in may watch and drive."""
    shows_installed: bool = False
    """Whether the menu lists installed robots and drivers."""
    trusted: Sequence[str] = ()
    """Third-party widgets that may run in the page without a sandbox."""
    recordings: Path | None = None
    """Folder for recordings of all sessions; None disables recording."""
    recorder: ServerRecorder | None = None
    """Object that writes audit entries about recordings; None to write no entries."""
    tls: TlsOptions = PLAIN
    """HTTPS certificate, and public names of a web server in front of this server."""
    sign_in: SignInOptions = field(default_factory=SignInOptions)
    """Sign-in options."""
    monitors: bool = False
    """Whether robots stay connected for their alarms by default."""
    notify: NotifyOptions | None = None
    """Hook for alarm notifications; None disables notifications."""
    foxglove: int | None = None
    """Port for Foxglove viewers; None if they use the dashboard's port."""
    is_in_fleet: bool = False
    """Whether to join the fleet of the data folder's membership."""
    metrics: Sequence[ReadingChoice] = ()
    """Readings that ``/metrics`` contains."""


def run_dashboard(
    profiles: Sequence[Profile],
    place: DashboardAddress,
    *,
    is_simulated: bool,
    on_ready: Callable[[ReadyDashboard], None],
    given: SettingsOf = _nothing,
    is_dev: bool = False,
    faults: Sequence[str] = (),
) -> int:
    """Serve the dashboard until a signal arrives, then return 0.

    Args:
        profiles: profiles of the initial robots.
        place: address, folders and options of the dashboard.
        is_simulated: whether emulated robots replace the real robots.
        on_ready: function that is called once, with the start addresses, when the server is ready.
        given: function that returns a profile's command-line settings.
        is_dev: whether to serve developer pages and reload changed documents.
        faults: faults to inject into emulated robots, such as ``loss=5%`` or ``tello:loss=5%``.

    Raises:
        UrcError: the port is not available, two robots have the same name, or a fault cannot be
            injected.
    """
    names = [profile.name for profile in profiles]
    for name in names:
        if names.count(name) > 1:
            raise Misuse(f"two robots have the name {name!r}; each name must be unique")
    if is_simulated:
        warn_without_rendering(profiles)
    faulty = FaultInjector() if is_simulated else None
    work = _serve(profiles, place, faulty, on_ready, given, is_dev, faults)
    return run_loop(work, code_when_ended=0, is_fast=True)


def _opened_access(stack: AsyncExitStack, data: Path, place: DashboardAddress) -> Access:
    """Return the identities of people, whose store the stack closes."""
    access = access_for(data, is_open=place.is_open)
    if access.control.store is not None:
        stack.callback(access.control.store.close)
    access.clock_check = partial(clock_warning, data)
    return access


async def _serve(
    profiles: Sequence[Profile],
    place: DashboardAddress,
    faulty: FaultInjector | None,
    on_ready: Callable[[ReadyDashboard], None],
    given: SettingsOf,
    is_dev: bool,
    faults: Sequence[str],
) -> int:
    async with AsyncExitStack() as stack:
        audit, place = _audited(stack, place)
        robot_options = robot_options_of(place, given, faulty)
        data = robot_options.data
        await _warn_of(data)
        access = _opened_access(stack, data, place)
        certificates = await certificates_of(place.tls, place.host, place.allowed_hosts, data)

        foxglove = FoxglovePort(place.foxglove) if place.foxglove is not None else None
        manager = ServiceManager()
        stack.callback(manager.tell, "STOPPING=1")

        def ready(url: str) -> None:
            addresses = ready_addresses(url, place.host, access, certificates, place.tls, foxglove)
            announce(stack, data, addresses)
            on_ready(addresses)
            _tell_gaps(place, robots)
            _begin_heartbeats(stack, manager, addresses.url)

        factory = RobotFactory(robot_options)
        robots = {
            profile.name: await _robot_at_start(stack, factory, place, profile, faulty)
            for profile in profiles
        }
        if faulty is not None:
            faulty.begin(faults)
            await stack.enter_async_context(_listening(faulty))
        remake = {name: partial(factory.robot, name) for name in robots} if is_dev else None
        options = replace(
            _options(place, data),
            access=access,
            data=data,
            audit=audit,
            remake=remake,
            robot_options=robot_options,
            certificates=certificates,
        )
        app: ASGIApp = build_app(robots, options)
        app = app if foxglove is None else foxglove.around(app)
        _freeze_loaded_objects()
        await serve(
            place.tls.around(app),
            host=place.host,
            port=place.port,
            on_ready=ready,
            certificates=certificates,
            allowed_hosts=place.allowed_hosts,
            further=[foxglove] if foxglove is not None else [],
            door=options.network.door if options.network is not None else None,
        )
    return 0


def _freeze_loaded_objects() -> None:
    """Exclude loaded objects from later garbage collections, to avoid delays."""
    gc.collect()
    gc.freeze()


def _network(data: Path) -> SiteNetwork:
    from urc.cli.fleet_network import network_of  # rarely needed

    return network_of(data)


def _missing(robot: Robot) -> MissingPackages:
    return missing_packages(robot.profile, robot.settings, built_in_catalog().transports)


def _warn_of_packages(robot: Robot) -> None:
    """Report a robot that no page can open because of a missing extra."""
    for text in _missing(robot).needed:
        complain(f"urc: {robot.profile.name} cannot be opened: {text}")


def _warn_of_metrics(choices: Iterable[ReadingChoice], robots: Mapping[str, Robot]) -> None:
    """Print a line for each chosen reading that no robot has."""
    for choice in choices:
        if not any(
            is_numeric(signal) and choice.covers(name, signal.name)
            for name, robot in robots.items()
            for signal in robot.profile.driver.signals.values()
        ):
            complain(f"urc serve: --metric {choice}: no robot has this numeric signal")


def _tell_gaps(place: DashboardAddress, robots: Mapping[str, Robot]) -> None:
    """Print what these robots cannot do; the lines follow the dashboard's address."""
    _tell_dark_cameras(robots.values())
    _warn_of_metrics(place.metrics, robots)


def _tell_dark_cameras(robots: Iterable[Robot]) -> None:
    """Print one line for each extra without which some of the robots show no video.

    The line follows the dashboard's address, because these robots work without their cameras.
    """
    blind: dict[str, list[str]] = {}
    for robot in robots:
        for text in _missing(robot).cameras:
            blind.setdefault(text, []).append(robot.profile.name)
    for text, names in blind.items():
        complain(f"no video of {', '.join(names)}: {text}")


def _audited(stack: AsyncExitStack, place: DashboardAddress) -> tuple[AuditLog, DashboardAddress]:
    """Open the audit log until `stack` closes; return it and a `place` with its recorder."""
    audit = AuditLog(own_folder(place.data) / FILE)
    stack.callback(audit.close)
    return audit, replace(place, recorder=ServerRecorder(audit.add))


def _options(place: DashboardAddress, data: Path) -> DashboardOptions:
    """Return the dashboard's options that the command line determines."""
    return DashboardOptions(
        allowed_hosts=(*place.allowed_hosts, *place.tls.hosts()),
        tiles=place.tiles,
        trusted=place.trusted,
        recordings=place.recordings,
        sign_in=place.sign_in,
        notifier=AlarmNotifier(place.notify) if place.notify is not None else None,
        network=_network(data) if place.is_in_fleet else None,
        metrics=place.metrics,
    )


async def _warn_of(data: Path) -> None:
    """Print warnings about a wrong clock and an interrupted restore of the data folder."""
    if warning := await asyncio.to_thread(clock_warning, data):
        complain(f"urc: {warning}")
    if is_interrupted(data):
        complain("urc: 'urc restore' was interrupted; run it again with --replace")


def _begin_heartbeats(stack: AsyncExitStack, manager: ServiceManager, url: str) -> None:
    """Notify systemd that the server is ready, and send heartbeats until `stack` closes."""
    manager.tell("READY=1", f"STATUS=dashboard {url}")
    watch = asyncio.ensure_future(manager.watch(partial(answers, url)))
    stack.callback(watch.cancel)


async def _robot_at_start(
    stack: AsyncExitStack,
    factory: RobotFactory,
    place: DashboardAddress,
    profile: Profile,
    faulty: FaultInjector | None,
) -> Robot:
    """Return a profile's robot; with `faulty`, emulate the robot even before a page opens."""
    robot = _first(factory, profile)
    _warn_of_packages(robot)
    if faulty is None:
        return robot
    emulated_robot = EmulatedRobot(robot.profile, robot.settings)
    stack.enter_context(faulty.watch(profile.name, emulated_robot))
    redirected = await stack.enter_async_context(
        stand_in(robot.profile, robot.settings, emulated_robot)
    )
    made = _robot(place, None, redirected, robot.settings)
    return replace(
        made,
        glimpse=partial(_seen, emulated_robot),
        is_emulated=True,
        is_monitored=robot.is_monitored,
    )


@asynccontextmanager
async def _listening(faulty: FaultInjector) -> AsyncIterator[None]:
    """Execute fault commands from standard input while the context is active."""
    task = asyncio.create_task(faulty.listen())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def robot_options_of(
    place: DashboardAddress, given: SettingsOf = _nothing, faulty: FaultInjector | None = None
) -> RobotOptions:
    """Return the options for a robot factory; with `faulty`, all robots are emulated."""
    return RobotOptions(
        own_folder(place.data),
        make=partial(_robot, place, faulty),
        tried=partial(_session, "none", None, faulty),
        given=given,
        shows_installed=place.shows_installed,
        monitors=place.monitors,
    )


def _motion(place: DashboardAddress) -> Motion:
    return "guarded" if place.has_guard else "here"


def _first(factory: RobotFactory, profile: Profile) -> Robot:
    """Return a robot from the command line, with its stored settings if they are valid."""
    try:
        return factory.robot(profile.name, profile)
    except UrcError as error:
        complain(f"urc: {error}; the stored settings of {profile.name} are ignored")
        return factory.robot(profile.name, profile, StoredSettings())


def _robot(
    place: DashboardAddress,
    faulty: FaultInjector | None,
    profile: Profile,
    values: Mapping[str, Value],
) -> Robot:
    """Return a robot whose session opens when its first page opens."""
    settings = values if faulty is None else _complete(profile, values)
    keep = None if place.recordings is None else partial(_kept, place.recordings, place.recorder)
    opened = partial(_session, _motion(place), keep, faulty, profile, settings)
    return Robot(profile, settings, opened, is_emulated=faulty is not None)


def _seen(emulated_robot: EmulatedRobot) -> Glimpse:
    """Return the preview of an emulated robot: camera image, top view or readings."""
    now_s = time.time()
    return (
        emulated_robot.camera(now_s)
        or emulated_robot.top_view(*_LOOK, now_s)
        or emulated_robot.readings(now_s)
    )


@asynccontextmanager
async def _session(
    motion: Motion,
    keep: Callable[[Session], AbstractAsyncContextManager[None]] | None,
    faulty: FaultInjector | None,
    profile: Profile,
    values: Mapping[str, Value],
) -> AsyncIterator[Session]:
    """Keep a session with a robot or its emulation open until the context ends."""
    transports = built_in_catalog().transports
    async with AsyncExitStack() as stack:
        settings = values
        if faulty is not None:
            settings = _complete(profile, values)
            emulated_robot = EmulatedRobot(profile, settings)
            stack.enter_context(faulty.watch(profile.name, emulated_robot))
            profile = await stack.enter_async_context(stand_in(profile, settings, emulated_robot))
        # All readers of a server count themselves as viewers.
        session = Session(profile, settings, transports, motion=motion, pauses_images=True)
        if keep is not None:
            # The recording opens first and closes last, to capture the start and end of the
            # session.
            await stack.enter_async_context(keep(session))
        yield await stack.enter_async_context(session)


@asynccontextmanager
async def _kept(
    folder: Path, audit: ServerRecorder | None, session: Session
) -> AsyncIterator[None]:
    """Record a session; if the recording fails, report the failure and keep the session open."""
    from urc.runtime.recording.recorder import recorded  # rarely needed

    profile = session.profile
    on_step = partial(audit.recording, NO_ACTOR, profile.name) if audit is not None else None
    keeping = recorded(session.hub, folder, profile, is_folder=True, on_step=on_step)
    async with AsyncExitStack() as stack:
        recorder = await stack.enter_async_context(keeping)
        try:
            yield
        finally:
            await stack.aclose()
            if recorder.fault:
                complain(f"urc: {profile.name}: {recorder.fault}")


def _complete(profile: Profile, values: Mapping[str, Value]) -> dict[str, Value]:
    """Return the settings for an emulation, with sample values in place of missing values."""
    return sample_settings(profile.settings) | dict(values)
