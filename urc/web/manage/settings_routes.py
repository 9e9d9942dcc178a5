"""Routes for a robot's settings page, for testing, storing and applying settings.

Layer 5. If the test fails, for example because the robot is switched off, the settings are stored
only if the user confirms.
"""

import asyncio
import json
from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from pathlib import PurePath
from typing import Final

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError, printable
from urc.runtime.probe import ProbeResult, probe
from urc.runtime.redaction import secret_texts
from urc.runtime.registries import built_in_catalog
from urc.runtime.secret_forms import SecretForms
from urc.runtime.server_recorder import Actor, ServerRecorder
from urc.runtime.settings import parse_setting
from urc.runtime.settings_store import StoredSettings
from urc.web.fleet.robots import RobotService, missing_settings
from urc.web.manage.jobs import Busy
from urc.web.manage.manager import Manager
from urc.web.manage.setting_groups import failed_field, namespace_faults, place_field
from urc.web.manage.settings_page import settings_page
from urc.web.manage.wire import ProbedTransport, SettingsAnswer, SettingsAsked
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, body_of, told
from urc.web.serve.rights import MAINTAIN, WATCH, ProtectedRoute
from urc.web.serve.visitor import visitor_of
from urc.web.show.cells import spoken
from urc.web.show.menu import NavigationLinks
from urc.web.words import t

__all__ = ["SettingsRoutes"]

_NO_STORE: Final = {"cache-control": "no-store"}
_LOOK_S: Final = 0.05
_END_S: Final = 5.0


class SettingsRoutes:
    """The routes for all robots' settings pages."""

    def __init__(self, manager: Manager, ways: NavigationLinks, recorder: ServerRecorder) -> None:
        """Create the routes.

        Args:
            manager: the operations on packages and robots.
            ways: the optional pages of this server, for the navigation links.
            recorder: receives an entry for each change.
        """
        self._manager = manager
        self._ways = ways
        self._recorder = recorder
        self._trying: set[str] = set()

    def routes(self) -> list[ProtectedRoute]:
        """Return the route for the settings page."""
        return [ProtectedRoute("/robots/{name}/settings", self.page, WATCH)]

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoint that stores the settings, keyed by the name of its API call."""
        return {"settings": self.save}

    async def page(self, request: Request) -> Response:
        """Show the settings page of a robot.

        The query parameter ``version`` selects an installed driver version, whose settings the page
        then shows; "" is the newest version. The choice of the version is not stored.
        """
        name = request.path_params["name"]
        html = await asyncio.to_thread(self._page, request, name)
        return HTMLResponse(html, headers=_NO_STORE)

    def _page(self, request: Request, name: str) -> str:
        factory = self._manager.factory
        lock = self._manager.lock_of(name)
        locks = factory.installed_robots().get(name, []) if lock is not None else []
        fault = ""
        try:
            kept = factory.settings_store(name).load()
        except UrcError as error:
            kept, fault = StoredSettings(), str(error)
        profile = self._profile(name)
        if profile is None:
            broken = self._manager.fleet.broken.get(name)
            if broken is None:
                raise HTTPException(404, t("This server has no robot called “{name}”.", name=name))
            profile, fault = Profile(name, broken.title, ""), broken.fault
        version = request.query_params.get("version")
        if version is not None and lock is not None:
            try:
                bare = self._document(name, version)
                profile, fault = factory.with_interfaces(bare, kept.interface), ""
            except UrcError as error:
                raise HTTPException(404, str(error)) from None
        filled = None if fault else factory.resolved_settings(profile, kept)
        return settings_page(
            request.state.nonce,
            name,
            profile,
            kept,
            filled.given if filled is not None else {},
            withheld=filled.withheld if filled is not None else (),
            ways=self._ways,
            driver=str(lock) if lock is not None else PurePath(profile.file).name,
            versions=[one.version for one in reversed(locks)],
            may_manage=visitor_of(request).may(MAINTAIN, name),
            fault=fault,
        )

    def _profile(self, name: str) -> Profile | None:
        robot = self._manager.fleet.robots.get(name)
        return robot.profile if robot is not None else None

    async def save(self, request: Request) -> Response:
        """Test the entered settings, then store and apply them."""
        name = request.path_params["name"]
        try:
            said = await body_of(request, SettingsAsked)
            if name in self._trying:
                raise Busy(f"the settings of {name} are already being tested")
            self._trying.add(name)
            try:
                return answer(await self._save(name, said, actor_of(request, name)))
            finally:
                self._trying.discard(name)
        except ApiError as refusal:
            return told(refusal.status, refusal.line, refusal.code)
        except Busy as error:
            return told(409, str(error))
        except UrcError as error:
            return told(422, str(error).strip().partition("\n")[0])

    async def _save(self, name: str, said: SettingsAsked, actor: Actor) -> SettingsAnswer:
        manager, factory = self._manager, self._manager.factory
        if name not in manager.fleet.robots and name not in manager.fleet.broken:
            raise ApiError(404, "this server has no robot with that name")
        manager.check_idle(name, is_correction=True)
        before = await asyncio.to_thread(self._kept, name)
        bare = await asyncio.to_thread(self._document, name, said.version)
        kept, faults = await asyncio.to_thread(self._filled_in, bare, before, said)
        robot = await asyncio.to_thread(factory.robot, name, bare, kept) if not faults else None
        faults = faults if robot is None else namespace_faults(bare, robot.settings)
        if faults or robot is None:
            text = t("Not saved: correct the marked fields")
            return SettingsAnswer(is_saved=False, text=text, faults=faults)
        missing = tuple(one.title or spoken(one.name) for one in missing_settings(robot))
        lines: tuple[ProbedTransport, ...] = ()
        if said.test and not missing:
            lines = await self._tried(name, bare, robot.settings)
            if any(one.verdict == "fails" for one in lines) and not said.anyway:
                text = t("Not saved: the robot cannot be reached")
                return SettingsAnswer(is_saved=False, text=text, lines=lines)
        manager.check_idle(name, is_correction=True)  # the test takes time
        await asyncio.to_thread(factory.settings_store(name).save, kept)
        changes = _changes(before, kept, bare, secret_texts(bare, robot.settings))
        if changes:
            self._recorder.settings_changed(actor, name, changes)
        await manager.apply_settings(name, robot, said.version)
        text = t("Saved and in use")
        if missing:
            text = t("Saved. Not set yet: {names}.", names=", ".join(missing))
        return SettingsAnswer(is_saved=True, text=text, missing=missing, lines=lines)

    def _kept(self, name: str) -> StoredSettings:
        try:
            return self._manager.factory.settings_store(name).load()
        except UrcError:
            return StoredSettings()  # damaged: the new values replace it

    def _document(self, name: str, version: str) -> Profile:
        """Return the robot's profile from the package version that the user chose."""
        manager, factory = self._manager, self._manager.factory
        lock = manager.lock_of(name)
        if lock is not None:
            locks = factory.installed_robots().get(name, [lock])
            if version and version not in [one.version for one in locks]:
                raise UrcError(f"{name} {version} is not installed")
            return factory.profile(factory.chosen_version(locks, version))
        return factory.reload(manager.fleet.robots[name].profile)

    def _filled_in(
        self, profile: Profile, before: StoredSettings, said: SettingsAsked
    ) -> tuple[StoredSettings, dict[str, str]]:
        """Return the settings to store, and the errors keyed by field."""
        texts, faults = _typed(profile, said)
        factory = self._manager.factory
        package = factory.package_of(profile)
        untouched = {
            name: before.settings.get(name, "")
            for name, text in said.settings.items()
            if text is None and name in profile.settings
        }
        old = {name: text for name, text in untouched.items() if text}
        kept = StoredSettings(
            version=said.version,
            interface=said.interface,
            settings=texts | old,
            destination=before.destination,
            package=package,
            monitors_alarms=said.monitors_alarms,
        )
        found = factory.resolved_settings(profile, kept)
        for name in untouched.keys() & found.withheld:
            faults[name] = t("Enter the value again: it was for another destination or package.")
        return msgspec.structs.replace(kept, destination=found.destination), faults

    async def _tried(
        self, name: str, profile: Profile, values: Mapping[str, Value]
    ) -> tuple[ProbedTransport, ...]:
        """Test all transports while the robot is disconnected; STOP ends the test immediately."""
        robot_options = self._manager.factory.robot_options
        service = self._manager.fleet.services.get(name)
        held_off = service.held_off() if service is not None else nullcontext()
        epoch = _epoch(service)
        async with held_off:
            work = probe(
                lambda: robot_options.tried(profile, values), built_in_catalog().transports
            )
            trying = asyncio.get_running_loop().create_task(work)
            try:
                while not trying.done():
                    if _epoch(service) != epoch:
                        raise Busy(t("STOP was pressed during the test: try again"))
                    await asyncio.wait((trying,), timeout=_LOOK_S)
            finally:
                trying.cancel()
                await asyncio.wait((trying,), timeout=_END_S)
            return tuple(_line(one, profile) for one in trying.result())


def _changes(
    before: StoredSettings, after: StoredSettings, profile: Profile, secrets: Iterable[str]
) -> dict[str, str | None]:
    """Return each changed setting's new text for the audit log; None for a secret."""
    hidden = SecretForms(secrets)
    changes: dict[str, str | None] = {
        name: hidden.hide(getattr(after, name))
        for name in ("version", "interface")
        if getattr(before, name) != getattr(after, name)
    }
    if before.monitors_alarms != after.monitors_alarms:
        changes["monitors_alarms"] = json.dumps(after.monitors_alarms)
    for name in sorted(before.settings.keys() | after.settings.keys()):
        text = after.settings.get(name, "")
        if text != before.settings.get(name, ""):
            setting = profile.settings.get(name)
            is_secret = setting is None or setting.is_secret
            changes[name] = None if is_secret else hidden.hide(text)
    return changes


def _epoch(service: RobotService | None) -> int:
    """Return a number that changes with every STOP and every change of the operator in control."""
    return service.controls.controller.lease.state.epoch if service is not None else 0


def _line(tried: ProbeResult, profile: Profile) -> ProbedTransport:
    if tried.verdict == "answers":
        field = place_field(profile, tried.transport)
    else:
        field = failed_field(profile, tried.transport, tried.cause)
    return ProbedTransport(
        tried.transport,
        tried.type,
        printable(tried.address),
        tried.verdict,
        printable(tried.text),
        tried.advice,
        tried.cause,
        field,
    )


def _typed(profile: Profile, said: SettingsAsked) -> tuple[dict[str, str], dict[str, str]]:
    """Return the valid inputs, and the errors of the invalid inputs, both keyed by field."""
    texts: dict[str, str] = {}
    faults: dict[str, str] = {}
    for name, setting in profile.settings.items():
        text = said.settings.get(name) or ""
        text = text if setting.is_secret else text.strip()
        if not text:
            continue
        try:
            parse_setting(setting, text)
            texts[name] = text
        except UrcError as error:
            faults[name] = printable(str(error))
    for name in said.settings:
        if name not in profile.settings:
            faults[name] = "the driver has no setting with this name"
    return texts, faults
