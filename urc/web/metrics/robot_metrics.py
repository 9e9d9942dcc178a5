"""The metrics of the served robots: connections, STOP, alarms, use, images and chosen readings.

Layer 5. The functions read the current state. Without an open session, a robot has no readings.
"""

import logging
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Final, NamedTuple, get_args

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, StateSetMetricFamily
from prometheus_client.metrics_core import Metric

from urc.model.values import AlarmPriority, Sample, Signal
from urc.runtime.hub import Hub, LinkState
from urc.web.fleet.robots import RobotService
from urc.web.metrics.metric_names import (
    ReadingChoice,
    is_chosen,
    is_numeric,
    metric_name,
    unit_name,
)

__all__ = ["MOST_READINGS", "robot_metrics"]

MOST_READINGS: Final = 2000
"""Maximum number of readings in one response; the metric ``urc_metrics_cut_readings`` counts the
others."""
_ROBOT: Final = ("robot", "site")
_STATES: Final[tuple[str, ...]] = get_args(LinkState)
_PRIORITIES: Final[tuple[AlarmPriority, ...]] = get_args(AlarmPriority)

log = logging.getLogger(__name__)


class _Reading(NamedTuple):
    labels: tuple[str, str, str]
    signal: Signal
    value: float


def robot_metrics(
    services: Mapping[str, RobotService], site: str, choices: Sequence[ReadingChoice]
) -> Iterator[Metric]:
    """Yield the metrics of robots.

    Args:
        services: the robots, keyed by their names in URLs.
        site: name of this site; "" outside a fleet.
        choices: the readings to publish.
    """
    robots = {name: one for name, one in services.items() if one.robot.playback is None}
    yield from _states(robots, site)
    yield _alarms(robots, site)
    yield from _sessions(robots, site)
    found = _readings(robots, site, choices)
    kept = [*islice(found, MOST_READINGS)]
    cut = sum(1 for _ in found)
    if cut:
        log.warning("metrics: %d readings are left out; at most %d fit", cut, MOST_READINGS)
    yield from _families(kept)
    text = "Chosen readings that were left out of this response."
    yield GaugeMetricFamily("urc_metrics_cut_readings", text, value=cut)


def _states(robots: Mapping[str, RobotService], site: str) -> Iterator[Metric]:
    is_open = GaugeMetricFamily(
        "urc_robot_session_open", "Whether the server is connected to the robot.", labels=_ROBOT
    )
    latched = GaugeMetricFamily("urc_robot_stop_latched", "Whether STOP is latched.", labels=_ROBOT)
    driven = GaugeMetricFamily(
        "urc_robot_driven", "Whether someone has the controls.", labels=_ROBOT
    )
    pages = GaugeMetricFamily(
        "urc_robot_pages", "Pages and driving programs of the robot.", labels=_ROBOT
    )
    for name, service in robots.items():
        state = service.controls.controller.lease.state
        labels = (name, site)
        is_open.add_metric(labels, service.is_open)
        latched.add_metric(labels, bool(state.latched_by))
        driven.add_metric(labels, state.holder is not None)
        pages.add_metric(labels, len(service.controls.operators))
    yield from (is_open, latched, driven, pages)


def _alarms(robots: Mapping[str, RobotService], site: str) -> Metric:
    found = GaugeMetricFamily(
        "urc_robot_alarms", "Annunciated alarms.", labels=(*_ROBOT, "priority")
    )
    for name, service in robots.items():
        records = service.alarms.list.records.values()
        counts = Counter(one.priority for one in records if one.is_annunciated)
        for priority in _PRIORITIES:
            found.add_metric((name, site, priority), counts[priority])
    return found


def _sessions(robots: Mapping[str, RobotService], site: str) -> Iterator[Metric]:
    """Yield the metrics of open sessions; a robot without a session has no such series."""
    links = StateSetMetricFamily(
        "urc_link_state", "State of a robot's connection.", labels=(*_ROBOT, "transport")
    )
    age = GaugeMetricFamily(
        "urc_robot_reading_age_seconds", "Age of the robot's newest reading.",
        labels=_ROBOT, unit="seconds",
    )  # fmt: skip
    images = CounterMetricFamily(
        "urc_robot_images", "Images and video frames sent to all pages in this session.",
        labels=_ROBOT,
    )  # fmt: skip
    for name, service in robots.items():
        live = service.open_session
        if live is None:
            continue
        hub, labels = live.session.hub, (name, site)
        for transport, link in hub.links.items():
            states = {one: one == link.state for one in _STATES}
            links.add_metric((*labels, transport), states)
        newest_s = max((one.time_s for one in _newest(hub)), default=None)
        if newest_s is not None:
            age.add_metric(labels, max(0.0, service.clock.now() - newest_s))
        images.add_metric(labels, live.fanout.images_count)
    yield from (links, age, images)


def _newest(hub: Hub) -> Iterator[Sample]:
    found = map(hub.latest, hub.signals)
    return (one for one in found if one is not None)


def _readings(
    robots: Mapping[str, RobotService], site: str, choices: Sequence[ReadingChoice]
) -> Iterator[_Reading]:
    """Yield the chosen readings that are known and not old."""
    for name, service in robots.items():
        live = service.open_session
        if live is None:
            continue
        hub, now_s = live.session.hub, service.clock.now()
        for signal in hub.signals.values():
            if not is_numeric(signal) or not is_chosen(choices, name, signal.name):
                continue
            sample = hub.latest(signal.name)
            value = _number(sample, signal, now_s)
            if value is not None:
                yield _Reading((name, site, signal.name), signal, value)


def _number(sample: Sample | None, signal: Signal, now_s: float) -> float | None:
    if sample is None or isinstance(sample.value, bool):
        return None
    if signal.stale_after_s and now_s - sample.time_s > signal.stale_after_s:
        return None
    if not isinstance(sample.value, (int, float)):
        return None
    try:
        return float(sample.value)
    except OverflowError:  # an integer beyond the range of a float
        return None


def _families(readings: Iterable[_Reading]) -> Iterator[Metric]:
    families: dict[tuple[str, str], GaugeMetricFamily] = {}
    for one in readings:
        name, unit = metric_name(one.signal.name), unit_name(one.signal.unit)
        family = families.get((name, unit))
        if family is None:
            text = f"Reading of robots, in {one.signal.unit or 'no unit'}."
            family = families[name, unit] = GaugeMetricFamily(
                name, text, labels=(*_ROBOT, "signal"), unit=unit
            )
        family.add_metric(one.labels, one.value)
    return iter(families.values())
