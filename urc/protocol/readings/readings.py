"""Samples of one engine: conversion of fields, alarms, and computed signals.

The module is pure: callers pass the time. Each engine has exactly one `Readings` object. A signal
has one alarm state, even if several frames set the signal. A computed signal uses the newest value
of each input.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from urc.expressions import ExpressionError, Template, defaulted_names
from urc.model.values import NOTHING, Alarm, FrameChange, Reading, Sample, Signal
from urc.protocol.readings.alarms import AlarmMonitor
from urc.protocol.readings.data_change_filter import DataChangeFilter
from urc.protocol.readings.tree_readings import STATIC_TOPIC, TreeReadings, tree_of
from urc.protocol.values.convert import BadValue
from urc.protocol.values.decode import Convert, build_converter
from urc.protocol.values.occupancy_grid import GridConverter
from urc.protocol.values.transform_tree import NotConnected
from urc.protocol.values.video_message import GAP, VideoConverter, Waiting

__all__ = ["Decode", "Readings"]

Decode = Callable[[Mapping[str, object], float], tuple[list[Sample], list[str]]]
"""Function that takes the fields of a frame and the time of receipt. It returns the samples and a
message for each rejected value."""


class _Computed(NamedTuple):
    name: str
    formula: Template
    inputs: tuple[str, ...]
    spare: frozenset[str]
    """Names of optional inputs, for which the formula has a default."""
    shortest_s: float
    """Minimum ``stale_after`` of the inputs, in seconds."""
    convert: Convert
    frame: Template | None
    change: FrameChange | None


class Readings:
    """A converter from fields to samples, which keeps the formula inputs and the alarm states.

    Args:
        signals: loaded signals, keyed by name; no computed signal may depend on itself.
        names: additional names for formulas, such as ``settings``.
    """

    def __init__(
        self, signals: Mapping[str, Signal], names: Mapping[str, object] = NOTHING
    ) -> None:
        self.signals = signals
        self.settings: Mapping[str, object] = names.get("settings", NOTHING)  # type: ignore[assignment]
        self.tree = tree_of(signals)
        """The transform tree of the driver; None if the driver has none."""
        self._converters: dict[str, Convert] = {}
        self._defers_grids = False
        self._kept: frozenset[str] = frozenset()  # `_in_order` below creates converters
        self._alarm_monitors = {
            name: AlarmMonitor(one.limits)
            for name, one in signals.items()
            if not one.limits.is_empty
        }
        self._change_filter = {
            name: DataChangeFilter(one)
            for name, one in signals.items()
            if one.deadband or one.debounce_s
        }
        self._timed = tuple(name for name in self._alarm_monitors if signals[name].limits.is_timed)
        self._last: dict[str, Sample] = {}
        """Newest samples of formula inputs and of signals in `_timed`, keyed by signal."""
        self._namespace: dict[str, object] = dict(names)
        self._computed = tuple(self._in_order())
        inputs = (name for one in self._computed for name in one.inputs)
        self._kept = frozenset((*inputs, *self._timed))

    def decoder(
        self, fields: Iterable[str], topic: str = "", throttle_s: float | None = None
    ) -> Decode:
        """Return a function that converts the given fields of a frame to samples.

        Fields whose names start with ``_`` are private to the document and are not converted.

        Args:
            fields: names of the frame's fields.
            topic: topic of the frame, which determines whether transforms are static.
            throttle_s: minimum time between two samples of a transform tree, in seconds; None means
                the default.
        """
        names = [name for name in fields if not name.startswith("_")]
        tree = self.tree
        if tree is not None and tree.name in names:
            if throttle_s is not None:
                tree.listen(throttle_s)
            others = self.decoder([name for name in names if name != tree.name])
            return self._tree_decoder(tree, others, topic.split("/")[-1] == STATIC_TOPIC)
        converters = {name: self._converter(name) for name in names}
        videos = {name: one for name, one in converters.items() if isinstance(one, VideoConverter)}

        def decode(found: Mapping[str, object], now: float) -> tuple[list[Sample], list[str]]:
            samples: list[Sample] = []
            refused: list[str] = []
            if videos and GAP in found:
                for video in videos.values():
                    video.lose()
            for name, raw in found.items():
                convert = converters.get(name)
                if convert is None:
                    continue
                try:
                    value = videos[name].take(raw, now) if name in videos else convert(raw)
                except Waiting:
                    continue
                except BadValue as error:
                    refused.append(f"{name}: {error}")
                else:
                    sample = Sample(name, value, now, self.alarm(name, value, now))
                    told = self._report(sample, now) if self._change_filter else sample
                    if told is not None:
                        samples.append(told)
            if self._kept:
                self.follow(samples, refused, now)
            return samples, refused

        return decode

    def _tree_decoder(self, tree: TreeReadings, others: Decode, is_static: bool) -> Decode:
        """Return a function that converts the fields of a frame with transforms."""

        def decode(found: Mapping[str, object], now: float) -> tuple[list[Sample], list[str]]:
            samples, refused = others(found, now)
            if found.get(tree.name) is None:
                return samples, refused
            try:
                faults = tree.receive(found[tree.name], now, is_static=is_static)
            except BadValue as fault:
                faults = [str(fault)]
            refused += [f"{tree.name}: {fault}" for fault in faults]
            return samples + self._tree_samples(tree, refused, now), refused

        return decode

    def _tree_samples(self, tree: TreeReadings, refused: list[str], now: float) -> list[Sample]:
        """Return the sample of the transform tree, and of all signals that depend on it."""
        sample = tree.sample(now)
        if sample is None:
            return []
        samples = [sample]
        if self._kept:
            self.follow(samples, refused, now)
        return samples

    def forget(self, names: Iterable[str]) -> None:
        """Drop what the given signals have kept for updates: occupancy grids and transforms."""
        for name in names:
            convert = self._converters.get(name)
            if isinstance(convert, GridConverter):
                convert.forget()
            elif self.tree is not None and name == self.tree.name:
                self.tree.forget()

    def forget_stamps(self) -> None:
        """Accept transforms with older timestamps, after a restart of the robot's simulation."""
        if self.tree is not None:
            self.tree.tree.forget_stamps()

    def defer_grids(self) -> None:
        """Return occupancy grids as `UnencodedGrid` from now on, except those that formulas use."""
        self._defers_grids = True
        for name, convert in self._converters.items():
            if isinstance(convert, GridConverter):
                convert.is_deferring = name not in self._kept

    def set_values(
        self, values: Mapping[str, object], now: float
    ) -> tuple[list[Sample], list[str]]:
        """Convert values that do not come from a frame, in the same way as a frame's fields."""
        return self.decoder(values)(values, now)

    def alarm(self, name: str, value: Reading, now: float) -> Alarm:
        """Update and return the alarm state of a signal."""
        alarm_monitor = self._alarm_monitors.get(name)
        return "" if alarm_monitor is None else alarm_monitor.update(value, now)

    def has_limits(self, name: str) -> bool:
        """Return whether the signal has alarm limits."""
        return name in self._alarm_monitors

    def keeps(self, name: str) -> bool:
        """Return whether a formula or a timed alarm needs the signal's samples from `follow`."""
        return name in self._kept

    @property
    def is_timed(self) -> bool:
        """Whether samples can change over time without new data."""
        return bool(self._timed or self._change_filter or self.tree)

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` may return samples; None if only a frame can change samples."""
        if not self.is_timed:
            return None
        times = [self._alarm_monitors[name].deadline for name in self._timed]
        times += [one.deadline for one in self._change_filter.values()]
        times += [self.tree.deadline] if self.tree is not None else []
        return min((time for time in times if time is not None), default=None)

    def tick(self, now: float) -> list[Sample]:
        """Return the samples that have changed by `now` without new data, with their arrival times.

        The result contains the newest samples of signals whose alarm has changed, and debounced
        samples. After a burst of transforms, it also contains the sample of the transform tree.
        """
        samples: list[Sample] = []
        if self.tree is not None:
            samples += self._tree_samples(self.tree, [], now)
        if self._change_filter:
            found = [one.tick(now) for one in self._change_filter.values()]
            settled = [sample for sample in found if sample is not None]
            self.follow(settled, [], now)
            samples += settled
        for name in self._timed:
            due = self._alarm_monitors[name].deadline
            if due is not None and due <= now:
                sample = self._last[name]._replace(alarm=self._alarm_monitors[name].tick(now))
                self._last[name] = sample
                samples.append(sample)
        return samples

    def follow(self, samples: list[Sample], refused: list[str], now: float) -> None:
        """Compute all signals that depend on `samples`, and append their samples to `samples`."""
        changed = set()
        for taken in samples:
            if taken.signal in self._kept:
                self._store(taken)
                changed.add(taken.signal)
        for computed in self._computed:
            if changed.isdisjoint(computed.inputs):
                continue
            try:
                sample = self._compute(computed, now)
            except (BadValue, ExpressionError) as error:
                refused.append(f"{computed.name}: {error}")
                continue
            if sample is not None and self._change_filter:
                sample = self._report(sample, now)
            if sample is not None:
                samples.append(sample)
                self._store(sample)
                changed.add(computed.name)

    def _report(self, sample: Sample, now: float) -> Sample | None:
        """Return the sample to report; None while the dead band or the debounce suppresses it."""
        change_filter = self._change_filter.get(sample.signal)
        return sample if change_filter is None else change_filter.filter(sample, now)

    def _store(self, sample: Sample) -> None:
        if sample.signal in self._kept:
            self._last[sample.signal] = sample
            self._namespace[sample.signal] = sample.value

    def _compute(self, computed: _Computed, now: float) -> Sample | None:
        """Return the sample; None if a required input has never been received."""
        time_s, is_absent = now, False
        for name in computed.inputs:
            if computed.change is not None and name == computed.change.tree:
                continue  # only the age of the transforms between the two frames counts
            sample = self._last.get(name)
            if sample is None:
                if name in computed.spare:
                    continue
                return None
            # A computed sample becomes stale as soon as the first of its inputs does.
            left_s = self.signals[name].stale_after_s - computed.shortest_s
            time_s = min(time_s, sample.time_s + left_s)
            is_absent |= sample.value is None
        try:
            move = None
            if computed.change is not None and computed.frame is not None and self.tree is not None:
                names = self._namespace
                move, oldest_s = self.tree.change(computed.change, computed.frame, names)
                left_s = self.tree.stale_after_s - computed.shortest_s
                time_s = min(time_s, oldest_s + left_s)
            raw = computed.formula.evaluate(self._namespace)
            value = computed.convert(raw if move is None else move(raw))
        except NotConnected:
            if self.tree is None or not self.tree.tree.links:
                return None  # no transforms have been received
            value = None
        except (ExpressionError, BadValue):
            if not is_absent:
                raise
            value = None
        return Sample(computed.name, value, time_s, self.alarm(computed.name, value, now))

    def _converter(self, name: str) -> Convert:
        if name not in self._converters:
            convert = self._converters[name] = build_converter(self.signals[name])
            if isinstance(convert, GridConverter):
                convert.is_deferring = self._defers_grids and name not in self._kept
        return self._converters[name]

    def _in_order(self) -> Iterable[_Computed]:
        """Yield the computed signals in dependency order."""
        waiting = {name: one for name, one in self.signals.items() if one.formula is not None}
        while waiting:
            ready = [
                name
                for name, one in waiting.items()
                if one.formula and not any(other in waiting for other in one.inputs)
            ]
            if not ready:
                raise ValueError(f"signals depend on each other: {', '.join(waiting)}")
            for name in ready:
                signal = waiting.pop(name)
                formula, change = signal.formula, signal.transform
                if formula is not None:
                    inputs = tuple(one for one in sorted(signal.inputs) if one in self.signals)
                    ages = [self.signals[one].stale_after_s for one in inputs]
                    yield _Computed(
                        name,
                        formula,
                        inputs,
                        defaulted_names(formula),
                        min(ages, default=0.0),
                        self._converter(name),
                        signal.frame,
                        change,
                    )
