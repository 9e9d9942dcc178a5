"""The table of all HTTP API calls: path, right, body, response and errors.

Layer 5. Both the routes and the OpenAPI document are generated from this table, so they cannot
differ. Only this module creates API routes, and each call declares the right that it requires.
"""

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

from urc.web.alarms.wire import (
    AcknowledgeAsked,
    AlarmAction,
    AlarmHistory,
    AlarmOverview,
    RobotAlarmList,
    ShelveAsked,
    UnshelveAsked,
)
from urc.web.api.group_wire import GroupAnswer, GroupAsked
from urc.web.api.stop_wire import StopAnswer, StopAsked
from urc.web.api.wire import (
    CommandAnswer,
    CommandAsked,
    LeaseAnswer,
    LeaseAsked,
    MotionAnswer,
    MotionAsked,
    RecordingList,
    RecordingState,
    RobotInfo,
    RobotList,
    SignalValue,
    SignalValues,
)
from urc.web.manage.wire import (
    Add,
    AuditResult,
    ControlState,
    HealthStatus,
    InstallRequest,
    JobDecision,
    JobNews,
    NewRobot,
    NewRobotAdded,
    PackageList,
    PlaybackRequest,
    PlaybackState,
    RefreshRequest,
    ReloadResult,
    RemovedPackages,
    ResultLine,
    SettingsAnswer,
    SettingsAsked,
    StopResult,
    TopicsAsked,
    TopicsFound,
    Url,
)
from urc.web.people.api_calls import PEOPLE_CALLS
from urc.web.serve.replies import Endpoint
from urc.web.serve.rights import (
    ANYONE,
    DRIVE,
    LOCAL,
    MAINTAIN,
    MAINTAIN_ANYWHERE,
    MAINTAIN_FRESH,
    MAINTAIN_SERVER,
    MAINTAIN_SERVER_FRESH,
    SIGNED_IN,
    WATCH,
    ProtectedRoute,
    Right,
)

__all__ = ["CALLS", "JSON", "Call", "Query", "api_routes"]

JSON: Final = "application/json"
_ROBOT: Final = "/api/v1/robots/{name}"


class Query(NamedTuple):
    """An optional query parameter."""

    name: str
    summary: str
    type: Literal["string", "integer", "number"] = "string"


class Call(NamedTuple):
    """One call."""

    name: str
    """Unique name, which is also the endpoint's key."""
    path: str
    right: Right
    summary: str
    answer: type | None
    """Type of the JSON response; None if the response is a file or a stream."""
    body: type | None = None
    """Type of the request body: bytes, or the type of a JSON body; None if there is no body."""
    method: Literal["GET", "POST"] = "GET"
    status: int = 200
    query: tuple[Query, ...] = ()
    errors: tuple[int, ...] = ()
    """Failure statuses of this call only; others follow from its right, path and body."""
    media: tuple[str, ...] = (JSON,)
    """Media types of the response."""
    is_body_needed: bool = True


_NAMES: Final = Query("signals", "Names of signals, separated by commas; default: all.")
_FILTERS: Final = (
    Query("robot", "Name of a robot."),
    Query("who", "Name of a person, device or program."),
    Query("what", "Kinds of entries, separated by commas."),
    Query("text", "Text that the entries must contain."),
    Query("since", "Earliest time of the entries, in seconds since 1970 (UTC).", "number"),
    Query("until", "Latest time of the entries, in seconds since 1970 (UTC).", "number"),
    Query("before", "Number of an entry; only older entries are returned.", "integer"),
    Query("last", "Maximum number of entries, at most 1000.", "integer"),
)
_NO_ROBOT: Final = (409, 429)
"""Failure statuses: URC cannot connect to the robot (409), or too many clients use it (429)."""

CALLS: Final[tuple[Call, ...]] = (
    Call("health", "/healthz", ANYONE, "The health and version of the server.", HealthStatus),
    # Robots
    Call("robots", "/api/v1/robots", SIGNED_IN, "The robots that you may watch.", RobotList),
    Call("robot", _ROBOT, WATCH, "A robot with its signals and commands.", RobotInfo),
    Call(
        "document",
        f"{_ROBOT}/document",
        MAINTAIN,
        "The document of a robot as one YAML file, without setting values.",
        None,
        errors=(409,),
        media=("application/yaml",),
    ),
    Call(
        "signals",
        f"{_ROBOT}/signals",
        WATCH,
        "The latest values of signals. URC connects to the robot if no connection is open.",
        SignalValues,
        query=(_NAMES,),
        errors=_NO_ROBOT,
    ),
    Call(
        "signal",
        f"{_ROBOT}/signals/{{signal}}",
        WATCH,
        "The latest value of one signal. An image is sent as a file; the header x-urc-age-ms"
        " contains its age in milliseconds.",
        SignalValue,
        errors=_NO_ROBOT,
        media=(
            *(JSON, "image/jpeg", "image/png", "image/gif", "image/bmp", "image/webp"),
            *("image/avif", "application/octet-stream"),
        ),
    ),
    Call(
        "stream",
        f"{_ROBOT}/stream",
        WATCH,
        "Server-Sent Events: “values” contains changed signals, “connections” contains the states"
        " of the connections, and “end” contains the reason why the stream ended. A slow reader"
        " misses intermediate values.",
        None,
        query=(_NAMES,),
        errors=_NO_ROBOT,
        media=("text/event-stream",),
    ),
    Call(
        "command",
        f"{_ROBOT}/commands/{{command}}",
        DRIVE,
        "Run a command or sequence, and return its reply. Some commands require a higher role than"
        " drive.",
        CommandAnswer,
        CommandAsked,
        "POST",
        errors=(409, 422, 424, 428, 429),
        is_body_needed=False,
    ),
    Call(
        "group_command",
        "/api/v1/commands",
        SIGNED_IN,
        "Run a confirmed command of several robots that declare it alike, also of other sites. Each"
        " robot requires the role of the command.",
        GroupAnswer,
        GroupAsked,
        "POST",
        errors=(404, 409, 428),
    ),
    Call(
        "lease",
        f"{_ROBOT}/lease",
        DRIVE,
        "Take, request, hand over or give up control of a robot, or reset STOP. A session ends"
        " 10 s after its last request.",
        LeaseAnswer,
        LeaseAsked,
        "POST",
        errors=(409, 429),
    ),
    Call(
        "motion",
        f"{_ROBOT}/motion",
        DRIVE,
        "Send the newest input of a held command. The robot stops if no input arrives for longer"
        " than the lease. For motion, the WebSocket `/ws` is preferable.",
        MotionAnswer,
        MotionAsked,
        "POST",
        errors=(409, 429),
    ),
    Call(
        "stop",
        f"{_ROBOT}/stop",
        ANYONE,
        "Stop a robot and latch its STOP. Resetting STOP requires the role drive.",
        StopResult,
        method="POST",
        errors=(409, 429),
    ),
    Call(
        "stop_several",
        "/api/v1/stop",
        ANYONE,
        "Stop several robots at once, also of other sites, and latch their STOPs. The reply arrives"
        " within 1 s and contains the result of each robot.",
        StopAnswer,
        StopAsked,
        "POST",
        errors=(404,),
    ),
    Call(
        "controls",
        f"{_ROBOT}/controls",
        WATCH,
        "The operator who drives a robot, and the state of its STOP latch.",
        ControlState,
    ),
    # Alarms
    Call(
        "alarms_overview",
        "/api/v1/alarms",
        SIGNED_IN,
        "The number of alarms of each robot that you may watch.",
        AlarmOverview,
    ),
    Call(
        "alarms",
        f"{_ROBOT}/alarms",
        WATCH,
        "A robot's alarms outside the normal state, most urgent first. The call does not"
        " connect to the robot.",
        RobotAlarmList,
    ),
    Call(
        "alarm_history",
        f"{_ROBOT}/alarms/history",
        WATCH,
        "Events of a robot's alarms, newest first.",
        AlarmHistory,
        query=(
            Query("kinds", "Kinds of events, separated by commas."),
            *(one for one in _FILTERS if one.name in ("text", "since", "until", "before", "last")),
        ),
        errors=(400,),
    ),
    Call(
        "alarms_acknowledge",
        f"{_ROBOT}/alarms/acknowledge",
        DRIVE,
        "Acknowledge the alarms that you saw. An alarm that has been raised again since then is"
        " skipped.",
        AlarmAction,
        AcknowledgeAsked,
        "POST",
        errors=(409,),
    ),
    Call(
        "alarms_shelve",
        f"{_ROBOT}/alarms/shelve",
        DRIVE,
        "Shelve alarms for at most 24 hours. When shelving ends, an active alarm is raised again.",
        AlarmAction,
        ShelveAsked,
        "POST",
        errors=(409,),
    ),
    Call(
        "alarms_unshelve",
        f"{_ROBOT}/alarms/unshelve",
        DRIVE,
        "Unshelve alarms.",
        AlarmAction,
        UnshelveAsked,
        "POST",
        errors=(409,),
    ),
    Call(
        "timeline",
        f"{_ROBOT}/timeline",
        MAINTAIN,
        "Search the audit log for entries of one robot, newest entry first.",
        AuditResult,
        query=tuple(one for one in _FILTERS if one.name != "robot"),
        errors=(400,),
    ),
    Call(
        "audit",
        "/api/v1/audit",
        MAINTAIN_ANYWHERE,
        "Search the audit log, newest entry first. Only entries about robots that you maintain are"
        " returned.",
        AuditResult,
        query=_FILTERS,
        errors=(400, 404),
    ),
    Call(
        "audit_export",
        "/api/v1/audit/export",
        MAINTAIN_ANYWHERE,
        "All audit log entries that you may see, as JSON lines, oldest entry first.",
        None,
        errors=(404,),
        media=("application/jsonl",),
    ),
    # Recordings
    Call(
        "recordings",
        "/api/v1/recordings",
        MAINTAIN_ANYWHERE,
        "The recordings of the robots that you maintain, newest first.",
        RecordingList,
        errors=(409,),
    ),
    Call(
        "recording_file",
        "/api/v1/recordings/{file}",
        MAINTAIN_ANYWHERE,
        "A recording as an MCAP file.",
        None,
        media=("application/octet-stream",),
    ),
    Call(
        "recording_state",
        f"{_ROBOT}/recordings",
        MAINTAIN,
        "The state of the recording that a program has started.",
        RecordingState,
    ),
    Call(
        "recording_start",
        f"{_ROBOT}/recordings/start",
        MAINTAIN,
        "Start a recording of a robot; the server needs a folder for recordings (--record).",
        RecordingState,
        method="POST",
        errors=_NO_ROBOT,
    ),
    Call(
        "recording_stop",
        f"{_ROBOT}/recordings/stop",
        MAINTAIN,
        "End the recording that a program has started.",
        RecordingState,
        method="POST",
        errors=(409,),
    ),
    Call(
        "playback",
        f"{_ROBOT}/recording",
        WATCH,
        "State of the playback of a recording.",
        PlaybackState,
    ),
    Call(
        "playback_move",
        f"{_ROBOT}/recording/move",
        DRIVE,
        "Play, pause or seek the playback of a recording.",
        PlaybackState,
        PlaybackRequest,
        "POST",
    ),
    # Settings and packages
    Call(
        "settings",
        f"{_ROBOT}/settings",
        MAINTAIN_FRESH,
        "Test the settings with the robot, then store and apply them.",
        SettingsAnswer,
        SettingsAsked,
        "POST",
        errors=(409, 422),
    ),
    Call(
        "dev_start",
        f"{_ROBOT}/dev/start",
        LOCAL,
        "Reload the documents of a robot; requires --dev.",
        ReloadResult,
        method="POST",
        errors=(409, 422),
    ),
    Call(
        "packages",
        "/api/v1/packages",
        SIGNED_IN,
        "Installed packages, packages available from repositories, and the current job.",
        PackageList,
        query=(
            Query("kinds", "Kinds of packages, separated by commas."),
            Query("words", "Words that each listed package must contain."),
        ),
    ),
    Call(
        "repositories_ask",
        "/api/v1/repositories/ask",
        SIGNED_IN,
        "Start a refresh of the package lists.",
        ResultLine,
        RefreshRequest,
        "POST",
        202,
        errors=(409, 422),
    ),
    Call(
        "repositories_add",
        "/api/v1/repositories",
        MAINTAIN_SERVER_FRESH,
        "Add a repository; the call fails if the repository does not respond.",
        ResultLine,
        Url,
        "POST",
        errors=(409, 422),
    ),
    Call(
        "repositories_remove",
        "/api/v1/repositories/remove",
        MAINTAIN_SERVER_FRESH,
        "Forget a repository.",
        ResultLine,
        Url,
        "POST",
        errors=(409, 422),
    ),
    Call(
        "packages_install",
        "/api/v1/packages/install",
        MAINTAIN_SERVER_FRESH,
        "Start a job that downloads a package with its dependencies and lists its permissions.",
        JobNews,
        InstallRequest,
        "POST",
        202,
        errors=(409, 422),
    ),
    Call(
        "topics_find",
        "/api/v1/new/topics",
        MAINTAIN_SERVER_FRESH,
        "Connect to a ROS robot and list the topics that fit the parts of a mobile base.",
        TopicsFound,
        TopicsAsked,
        "POST",
        errors=(409, 422),
    ),
    Call(
        "robots_add",
        "/api/v1/new/robot",
        MAINTAIN_SERVER_FRESH,
        "Add a ROS robot with a profile written from its topics.",
        NewRobotAdded,
        NewRobot,
        "POST",
        201,
        errors=(409, 422),
    ),
    Call(
        "packages_add",
        "/api/v1/packages/add",
        MAINTAIN_SERVER_FRESH,
        "Start a job that adds the package at a path in a repository or on the server.",
        JobNews,
        Add,
        "POST",
        202,
        errors=(409, 422),
    ),
    Call(
        "packages_upload",
        "/api/v1/packages/upload",
        MAINTAIN_SERVER_FRESH,
        "Start a job that adds the package, bundle or interface.yaml in the request body.",
        JobNews,
        bytes,
        "POST",
        202,
        query=(Query("name", "Name of the uploaded file."),),
        errors=(409, 422),
    ),
    Call(
        "packages_update",
        "/api/v1/packages/update",
        MAINTAIN_SERVER_FRESH,
        "Start a job that downloads a newer version of a package and lists the changes.",
        JobNews,
        InstallRequest,
        "POST",
        202,
        errors=(409, 422),
    ),
    Call(
        "packages_back",
        "/api/v1/packages/back",
        MAINTAIN_SERVER_FRESH,
        "Restore the version that a package had before its last update.",
        RemovedPackages,
        InstallRequest,
        "POST",
        errors=(409, 422),
    ),
    Call(
        "packages_remove",
        "/api/v1/packages/remove",
        MAINTAIN_SERVER_FRESH,
        "Remove a package; unless “yes” is true, only list the packages that would be removed.",
        RemovedPackages,
        InstallRequest,
        "POST",
        errors=(409, 422),
    ),
    Call(
        "job_agree",
        "/api/v1/job/agree",
        MAINTAIN_SERVER_FRESH,
        "Approve the package of the current job and install it.",
        JobNews,
        JobDecision,
        "POST",
        errors=(409, 422),
    ),
    Call(
        "job_cancel",
        "/api/v1/job/cancel",
        MAINTAIN_SERVER,
        "Cancel the job, unless its installation has started.",
        JobNews,
        JobDecision,
        "POST",
        errors=(409, 422),
    ),
    # People, devices, programs and sign-ins
    *(
        Call(
            one.name,
            f"/api/v1/{one.path}",
            one.right,
            one.summary,
            one.answer,
            one.body,
            "POST" if one.is_post else "GET",
            errors=(403, 404, 409, 422, 429, 503),
        )
        for one in PEOPLE_CALLS
    ),
)


def api_routes(endpoints: Mapping[str, Endpoint]) -> list[ProtectedRoute]:
    """Return the routes of all calls that have an endpoint.

    Args:
        endpoints: endpoints, keyed by call name; a server without managers has no manager calls.

    Raises:
        ValueError: an endpoint has no call in the table.
    """
    unknown = endpoints.keys() - {call.name for call in CALLS}
    if unknown:
        raise ValueError(f"endpoints without a call: {', '.join(sorted(unknown))}")
    return [
        ProtectedRoute(call.path, endpoints[call.name], call.right, methods=[call.method])
        for call in CALLS
        if call.name in endpoints
    ]
