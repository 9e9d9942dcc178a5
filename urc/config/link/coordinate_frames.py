"""Checks the coordinate frames of signals, and the transform tree that connects them."""

from collections.abc import Callable, Iterable

from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import Template
from urc.model.driver import Driver

__all__ = ["link_coordinate_frames"]

_Check = Callable[[Node, Template, Iterable[str]], None]


def link_coordinate_frames(part: Node, driver: Driver, check: _Check, problems: Problems) -> None:
    """Check the frames of all signals at `part`; `check` checks the names in a template."""
    texts = {name for name, one in driver.signals.items() if one.type == "string"}
    trees = [name for name, one in driver.signals.items() if one.type == "transform_tree"]
    for name, inner in part.named("signals").items():
        signal = driver.signals[name]
        if signal.type == "transform_tree" and name != trees[0]:
            problems.error(
                inner,
                "duplicate-name",
                f"the driver already has the transform tree {trees[0]!r}",
                key=True,
                hint=f"let several messages set {trees[0]!r}: a robot has one transform tree",
            )
        frame = inner.get("frame")
        if frame is not None and signal.frame is not None:
            _check_frame(frame, signal.frame, driver, texts, check, problems)
        if signal.formula is not None and inner.get("transform") and signal.transform is None:
            _report_incomplete(inner, driver, trees, problems)


def _check_frame(
    part: Node,
    frame: Template,
    driver: Driver,
    texts: Iterable[str],
    check: _Check,
    problems: Problems,
) -> None:
    """Check that a frame's name uses only settings and text signals."""
    others = sorted(frame.names & driver.signals.keys() - set(texts))
    if others:
        problems.error(
            part,
            "wrong-type",
            f"{others[0]!r} has the type {driver.signals[others[0]].type}, but the name of a frame"
            " is text",
            hint=did_you_mean("", texts, "text signals"),
        )
        return
    check(part, frame, texts)


def _report_incomplete(part: Node, driver: Driver, trees: list[str], problems: Problems) -> None:
    """Report why the value of a signal can't be changed to another frame."""
    place = part.must("transform")
    formula = driver.signals[part.name].formula
    names = sorted((formula.names if formula else frozenset()) & driver.signals.keys())
    frames = {name: driver.signals[name].frame for name in names}
    known = {name: one.source for name, one in frames.items() if one is not None}
    if not trees:
        problems.error(
            place,
            "unknown-signal",
            "'transform' needs a signal of type transform_tree",
            hint="add such a signal, and messages that set it from /tf and /tf_static",
        )
    elif not known:
        problems.error(
            place,
            "missing-key",
            f"no signal in 'value' declares a frame ({', '.join(names) or 'it has no signals'})",
            hint="add the frame of the robot's values, such as frame: odom, to one of them",
        )
    else:
        told = ", ".join(f"{name} in {frame!r}" for name, frame in known.items())
        problems.error(
            place,
            "wrong-form",
            f"the signals in 'value' refer to different frames: {told}",
            hint="change each value by itself, and combine the results in another signal",
        )
