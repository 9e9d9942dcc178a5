"""A JSON document as robots send them, and two ways to read it by hand."""

import copy
import json

import orjson

from urc.model.values import Sample

__all__ = ["DOCUMENT", "by_json", "by_orjson", "json_lines"]

DOCUMENT = {
    "header": {
        "seq": 48213,
        "stamp": {"sec": 1700000000, "nanosec": 250000000},
        "frame_id": "odom",
    },
    "child_frame_id": "base_link",
    "pose": {
        "pose": {
            "position": {"x": 1.25, "y": -0.5, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.3826, "w": 0.9239},
        },
        "covariance": [0.01, 0.0, 0.0, 0.01],
    },
    "twist": {
        "twist": {
            "linear": {"x": 0.42, "y": 0.0, "z": 0.0},
            "angular": {"x": 0.0, "y": 0.0, "z": -0.11},
        }
    },
    "battery": {"percentage": 0.87, "voltage": 24.3, "present": True, "cells": [4.05, 4.06, 4.05]},
    "state": {
        "mode": "AUTO",
        "estop": False,
        "errors": [],
        "uptime_s": 86400.25,
        "host": "rover-7.local",
        "version": "1.12.0-rc.4",
    },
}


def by_json(line: bytes, now: float) -> list[Sample] | None:
    """The standard library and subscripts."""
    document = json.loads(line)
    pose, twist = document["pose"]["pose"], document["twist"]["twist"]
    return [
        Sample("x", pose["position"]["x"], now),
        Sample("y", pose["position"]["y"], now),
        Sample("w", pose["orientation"]["w"], now),
        Sample("speed", twist["linear"]["x"], now),
        Sample("turn", twist["angular"]["z"], now),
        Sample("volts", document["battery"]["voltage"], now),
        Sample("cell", document["battery"]["cells"][0], now),
        Sample("mode", document["state"]["mode"], now),
    ]


def by_orjson(line: bytes, now: float) -> list[Sample] | None:
    """The fastest decoder there is; what is not there gives no sample, null one without a value."""
    try:
        document = orjson.loads(line)
    except orjson.JSONDecodeError:
        return None
    samples: list[Sample] = []
    pose = (document.get("pose") or {}).get("pose") or {}
    position, orientation = pose.get("position") or {}, pose.get("orientation") or {}
    twist = (document.get("twist") or {}).get("twist") or {}
    linear, angular = twist.get("linear") or {}, twist.get("angular") or {}
    battery, state = document.get("battery") or {}, document.get("state") or {}
    if "x" in position:
        samples.append(Sample("x", position["x"], now))
    if "y" in position:
        samples.append(Sample("y", position["y"], now))
    if "w" in orientation:
        samples.append(Sample("w", orientation["w"], now))
    if "x" in linear:
        samples.append(Sample("speed", linear["x"], now))
    if "z" in angular:
        samples.append(Sample("turn", angular["z"], now))
    if "voltage" in battery:
        samples.append(Sample("volts", battery["voltage"], now))
    if battery.get("cells"):
        samples.append(Sample("cell", battery["cells"][0], now))
    if "mode" in state:
        samples.append(Sample("mode", state["mode"], now))
    return samples


def json_lines() -> list[bytes]:
    """Return 20 documents, of which one lacks a field and another one has null in its place."""
    lacking, null = copy.deepcopy(DOCUMENT), copy.deepcopy(DOCUMENT)
    del lacking["battery"]["voltage"]  # type: ignore[attr-defined]
    null["twist"]["twist"]["linear"]["x"] = None  # type: ignore[index]
    documents = [DOCUMENT] * 9 + [lacking] + [DOCUMENT] * 9 + [null]
    return [json.dumps(one, separators=(",", ":")).encode() for one in documents]
