"""The sender of a request, with the name shown to other people and in the audit log.

Layer 5. Pure.
"""

from starlette.requests import HTTPConnection

from urc.access.directory import NOBODY, Identity
from urc.motion.lease import Operator
from urc.runtime.server_recorder import Actor, ServerRecorder
from urc.web.serve.visitor import is_loopback, peer_of, visitor_of

__all__ = ["actor_of", "record_admission", "record_bad_token", "stopper_of"]


def actor_of(connection: HTTPConnection, robot: str = "") -> Actor:
    """Return the visitor of a request as an actor with its current role.

    Args:
        connection: the request.
        robot: name of the robot that the request is about; "" for the whole server.
    """
    visitor = visitor_of(connection)
    who = visitor.identity
    role = visitor.role(robot) if robot else visitor.best_role()
    place = peer_of(connection, robot).place
    way = "key" if visitor.is_local else who.way  # programs send the start key as a bearer token
    return Actor(who.name, who.principal, who.kind, role or "", way, place, who.sign_in)


def stopper_of(connection: HTTPConnection, robot: str) -> Operator:
    """Return the visitor who presses a robot's STOP, with the name shown to other people."""
    visitor = visitor_of(connection)
    who = visitor.identity
    host = connection.client.host if connection.client else ""
    is_near = visitor.is_local and is_loopback(host)
    if visitor.is_known and not visitor.is_local:
        name = who.name
    else:
        name = "a screen on this machine" if is_near or not host else host
    return Operator(
        "",
        name,
        visitor.role(robot),
        who=who.name,
        principal=who.principal,
        person=who.person,
        way="key" if visitor.is_local else who.way,
        place="" if is_near else host,
        kind=who.kind,
    )


def record_admission(recorder: ServerRecorder, who: Identity, place: str, agent: str) -> None:
    """Record the use of a start key or single-use code.

    Args:
        recorder: writer of the audit entries.
        who: the new identity; `NOBODY` for a wrong key.
        place: network address.
        agent: browser and operating system, such as “Chrome on Android”.
    """
    if who == NOBODY:
        recorder.sign_in_failed("key", place, "the start key is wrong, or from an earlier start")
    else:
        actor = Actor(who.name, who.principal, who.kind, "administer", "key", place, who.sign_in)
        recorder.signed_in(actor, agent)


def record_bad_token(recorder: ServerRecorder, place: str) -> None:
    """Record a request with an unknown, expired or revoked token; repeated requests are counted.

    Args:
        recorder: writer of the audit entries.
        place: network address.
    """
    recorder.sign_in_failed("token", place, "the token is unknown, expired or revoked")
