"""A Zenoh router with a device, as a program: ``python -m … PORT [SETTINGS [LATE_S [KEY]]]``.

Prints a line of JSON for each value, request and token that it sees. It publishes what it is told
on its standard input: a line of JSON with a key and a value.
"""

import json
import sys
import threading
import time
from typing import Any

import zenoh

_printing = threading.Lock()


def say(kind: str, key: object, value: object = None, **more: object) -> None:
    """Print one line."""
    with _printing:
        sys.stdout.write(f"{json.dumps({'kind': kind, 'key': str(key), 'value': value, **more})}\n")
        sys.stdout.flush()


def text(payload: Any) -> str | None:
    """Return a value as text; a long one as its length."""
    if payload is None:
        return None
    data = payload.to_bytes()
    return data.decode("utf-8", "replace") if len(data) < 1000 else f"{len(data)} bytes"


def heard(sample: Any) -> None:
    say("put", sample.key_expr, text(sample.payload), encoding=str(sample.encoding))


def asked(query: Any) -> None:
    """Answer by the key: a value, a refusal, or nothing."""
    say("get", query.key_expr, text(query.payload), parameters=str(query.parameters))
    key = str(query.key_expr)
    if key == "robot/battery":
        query.reply(key, b"80")
    elif key == "robot/locked":
        query.reply_err(b"the robot\nis locked")
    query.drop()


def seen(sample: Any) -> None:
    if str(sample.key_expr) == "robot/alive":
        return  # its own
    is_put = sample.kind == zenoh.SampleKind.PUT
    say("alive" if is_put else "gone", sample.key_expr)


def main() -> None:
    """Run until the standard input ends."""
    settings = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{sys.argv[1]}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        **(json.loads(sys.argv[2]) if len(sys.argv) > 2 else {}),
    }
    late_s = float(sys.argv[3]) if len(sys.argv) > 3 else 0.0
    subscribed = sys.argv[4] if len(sys.argv) > 4 else "**"
    with zenoh.open(zenoh.Config.from_json5(json.dumps(settings))) as session:
        if late_s:  # it is a router at once, and a device later
            say("ready", "")
            time.sleep(late_s)
        session.declare_subscriber(subscribed, zenoh.handlers.Callback(heard))
        session.declare_queryable("robot/*", zenoh.handlers.Callback(asked))
        session.liveliness().declare_subscriber("**", zenoh.handlers.Callback(seen), history=True)
        token = session.liveliness().declare_token("robot/alive")
        say("ready" if not late_s else "subscribed", "")
        for line in sys.stdin:
            told = json.loads(line)
            if told["key"] == "robot/alive":
                token.undeclare()
            elif told["value"] is None:
                session.delete(told["key"])
            else:
                session.put(told["key"], told["value"].encode())


if __name__ == "__main__":
    main()
