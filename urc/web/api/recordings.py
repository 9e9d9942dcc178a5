"""Recordings over HTTP: files in the server's folder and recordings started by programs.

Layer 5. Programs specify a file name in the folder, never a path. A thread reads the folder,
because reading would block the event loop. A recording ends on request, when the robot's session
ends, or after `LONGEST_S`.
"""

import asyncio
import os
import re
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from starlette.requests import Request
from starlette.responses import FileResponse, Response

from urc.runtime.server_recorder import ServerRecorder
from urc.web.api.sessions import opened
from urc.web.api.wire import RecordingInfo, RecordingList, RecordingState
from urc.web.fleet.fleet import service_of
from urc.web.fleet.robots import LiveSession, RobotService
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, answers_errors
from urc.web.serve.rights import MAINTAIN, MAINTAIN_SERVER
from urc.web.serve.visitor import peer_of, visitor_of

if TYPE_CHECKING:
    from urc.runtime.recording.recorder import Recorder, RecordingStep

__all__ = ["LONGEST_S", "MOST_LISTED", "RecordingCalls"]

LONGEST_S: Final = 24 * 3600.0
"""Longest recording that a program can start, in seconds."""
MOST_LISTED: Final = 1000
_BEGIN_S: Final = 5.0
_LOOK_S: Final = 0.02
_FROM_START: Final = "bytes=0-"
"""Beginning of a Range header that asks for the first byte; only such requests count as new
downloads."""
_NAME: Final = re.compile(
    r"(?P<robot>[a-z][a-z0-9-]*)-(?P<began>[0-9]{8}T[0-9]{6}Z)(?:-[0-9]+)?\.mcap", re.ASCII
)
_IDLE: Final = RecordingState(active=False, file="", messages=0, fault="")


class _Running:
    def __init__(self) -> None:
        self.stop = asyncio.Event()
        self.recorder: Recorder | None = None
        self.fault = ""
        self.task: asyncio.Task[None] | None = None

    @property
    def state(self) -> RecordingState:
        recorder = self.recorder
        if recorder is None:
            return RecordingState(active=True, file="", messages=0, fault=self.fault)
        return RecordingState(
            active=self.task is not None and not self.task.done() and not recorder.fault,
            file=recorder.file.name if recorder.is_begun else "",
            messages=recorder.counts.total(),
            fault=recorder.fault or self.fault,
        )


class RecordingCalls:
    """The recording endpoints."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        folder: Path | None,
        audit: ServerRecorder,
    ) -> None:
        """Create the endpoints.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            folder: recordings folder; None disables recordings.
            audit: receives an entry for each start, end and download.
        """
        self._services = services
        self._audit = audit
        self._folder = folder
        self._running: dict[str, _Running] = {}
        """Recordings started by programs, keyed by the robot's name in URLs."""

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoints, keyed by call name."""
        return {
            "recordings": self.recordings,
            "recording_file": self.file,
            "recording_state": self.state,
            "recording_start": self.start,
            "recording_stop": self.stop,
        }

    async def close(self) -> None:
        """End all recordings and finish their files."""
        running = list(self._running.values())
        for one in running:
            one.stop.set()
        tasks = [one.task for one in running if one.task is not None]
        await asyncio.gather(*tasks, return_exceptions=True)

    # Files

    @answers_errors
    async def recordings(self, request: Request) -> Response:
        """Return the recordings of robots that the visitor may maintain."""
        found = await asyncio.to_thread(_files, self._folder) if self._folder else []
        active = {
            one.recorder.file.name
            for one in self._running.values()
            if one.recorder is not None and one.state.active
        }
        mine = [one for one in found if self._may_read(request, one.robot)]
        return answer(
            RecordingList(
                tuple(
                    RecordingInfo(one.file, one.robot, one.began, one.bytes, one.file in active)
                    for one in mine
                )
            )
        )

    @answers_errors
    async def file(self, request: Request) -> Response:
        """Return a recording as a file."""
        name = request.path_params["file"]
        match = _NAME.fullmatch(name)
        if self._folder is None or match is None or not self._may_read(request, match["robot"]):
            raise ApiError(404, "there is no recording with that name", "unknown-recording")
        path = self._folder / name
        if not await asyncio.to_thread(_is_plain_file, path):
            raise ApiError(404, "there is no recording with that name", "unknown-recording")
        if request.headers.get("range", _FROM_START).startswith(_FROM_START):
            actor = actor_of(request)
            self._audit.recording(actor, match["robot"], "downloaded", name)
        request.state.is_file = True
        headers = {"cache-control": "no-store"}
        return FileResponse(
            path, headers=headers, media_type="application/octet-stream", filename=name
        )

    def _may_read(self, request: Request, robot: str) -> bool:
        """Return whether the visitor may maintain the robot whose document is named `robot`."""
        visitor = visitor_of(request)
        served = [name for name, one in self._services().items() if one.robot.profile.name == robot]
        return visitor.may(MAINTAIN_SERVER) or any(visitor.may(MAINTAIN, one) for one in served)

    # Recordings started by programs

    @answers_errors
    async def state(self, request: Request) -> Response:
        """Return the state of the recording that a program started for the robot."""
        name, _ = service_of(self._services(), request)
        running = self._running.get(name)
        return answer(running.state if running is not None else _IDLE)

    @answers_errors
    async def start(self, request: Request) -> Response:
        """Connect to the robot and start a recording."""
        from urc.runtime.recording.recorder import check_installed  # an extra

        name, service = service_of(self._services(), request)
        if self._folder is None:
            text = "this server has no folder for recordings: start it with --record FOLDER"
            raise ApiError(409, text, "no-folder")
        check_installed()
        running = self._running.get(name)
        if running is not None and running.state.active:
            raise ApiError(409, "a program is already recording this robot", "recording")
        if service.robot.playback is not None:
            raise ApiError(409, "a playback cannot be recorded", "recorded")
        running = self._running[name] = _Running()
        stack = ExitStack()
        try:
            live = await opened(service, peer_of(request, name), stack)
        except ApiError:
            del self._running[name]
            stack.close()
            raise
        on_step = partial(self._audit.recording, actor_of(request, name), name)
        work = self._record(running, service, live, stack, on_step)
        running.task = asyncio.create_task(work)
        await _until_begun(running)
        if running.state.fault:
            raise ApiError(409, running.state.fault, "not-written")
        return answer(running.state)

    @answers_errors
    async def stop(self, request: Request) -> Response:
        """End a robot's recording and finish the file."""
        name, _ = service_of(self._services(), request)
        running = self._running.get(name)
        if running is None or running.task is None or not running.state.active:
            raise ApiError(409, "no program is recording this robot", "not-recording")
        running.stop.set()
        await asyncio.wait((running.task,))
        return answer(running.state)

    async def _record(
        self,
        running: _Running,
        service: RobotService,
        live: LiveSession,
        stack: ExitStack,
        on_step: "RecordingStep",
    ) -> None:
        from urc.runtime.recording.recorder import recorded

        assert self._folder is not None  # noqa: S101 - `start` has checked it
        profile = service.robot.profile
        with stack:
            async with recorded(
                live.session.hub, self._folder, profile, is_folder=True, on_step=on_step
            ) as recorder:
                running.recorder = recorder
                loop = asyncio.get_running_loop()
                until = loop.time() + LONGEST_S
                while loop.time() < until and not recorder.fault:
                    waits = [
                        asyncio.ensure_future(one.wait()) for one in (running.stop, live.ended)
                    ]
                    done, pending = await asyncio.wait(
                        waits, timeout=1.0, return_when=asyncio.FIRST_COMPLETED
                    )
                    for one in pending:
                        one.cancel()
                    if done:
                        return


async def _until_begun(running: _Running) -> None:
    loop = asyncio.get_running_loop()
    until = loop.time() + _BEGIN_S
    while loop.time() < until:
        recorder = running.recorder
        if recorder is not None and (recorder.is_begun or recorder.fault):
            return
        await asyncio.sleep(_LOOK_S)  # the recorder's thread sets both
    running.stop.set()
    running.fault = f"the file was not created within {_BEGIN_S:g} s"


def _files(folder: Path) -> list[RecordingInfo]:
    found = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                match = _NAME.fullmatch(entry.name)
                if match is not None and entry.is_file(follow_symlinks=False):
                    size = entry.stat(follow_symlinks=False).st_size
                    found.append(
                        RecordingInfo(entry.name, match["robot"], match["began"], size, False)
                    )
    except FileNotFoundError:
        return []  # nothing has been recorded yet
    except OSError as error:
        raise ApiError(409, f"{folder.name}: {error.strerror}", "not-readable") from None
    found.sort(key=lambda one: (one.began, one.file), reverse=True)
    return found[:MOST_LISTED]


def _is_plain_file(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()
