"""Readings: alarms that last, and signals that are computed from others."""

import pytest

from tests.dialogue import Dialogue
from urc.expressions import compile_expression
from urc.model.values import AlarmAttributes, AlarmLimits, Conversion, Sample, Signal
from urc.protocol.readings.readings import Readings

VOLTS = Signal(
    "volts", limits=AlarmLimits(lolo=10, low=12, hysteresis=1, for_s=3.0), stale_after_s=3
)


def signal(name: str, value: str = "", **more: object) -> Signal:
    """Return a signal that is set by frames, or computed."""
    formula = compile_expression(value) if value else None
    return Signal(name, formula=formula, **{"stale_after_s": 3.0, **more})  # type: ignore[arg-type]


def readings(*signals: Signal) -> Readings:
    """Return the readings of a driver with these signals."""
    return Readings({one.name: one for one in signals}, {"settings": {"cells": 4}})


def values(samples: list[Sample]) -> dict[str, object]:
    """Return name → value."""
    return {sample.signal: sample.value for sample in samples}


def alarms(limits: AlarmLimits, *readings_at: tuple[float, object]) -> list[str]:
    """Return the alarm of each of some readings in turn."""
    made = readings(Signal("v", "array" if limits.for_s < 0 else "number", limits=limits))
    return [made.set_values({"v": value}, time)[0][0].alarm for time, value in readings_at]


def test_a_limit_is_passed_at_its_very_value_and_left_past_the_hysteresis() -> None:
    """The words of the schema: at or below it is a warning."""
    found = alarms(AlarmLimits(low=20, hysteresis=2), (0, 20), (1, 21.9), (2, 22), (3, 21))
    assert found == ["low", "low", "", ""]


def test_the_graver_alarm_goes_first_and_leaves_the_lighter_one() -> None:
    """Coming back from lolo, low holds as if it had been there all the time."""
    limits = AlarmLimits(lolo=10, low=20, high=80, hihi=90, hysteresis=2)
    values_in_turn = (5, 11, 13, 21, 23, 95, 89, 81, 77)
    found = alarms(limits, *enumerate(values_in_turn))
    assert found == ["lolo", "lolo", "low", "low", "", "hihi", "hihi", "high", ""]


def test_an_alarm_begins_only_when_the_value_has_stayed() -> None:
    """Each limit has its own time; one good reading begins it anew."""
    limits = AlarmLimits(lolo=10, low=20, for_s=3)
    found = alarms(limits, (0, 15), (2, 15), (3, 15), (4, 5), (6.9, 5), (7, 5), (8, 30), (9, 5))
    assert found == ["", "", "low", "low", "low", "lolo", "", ""]


def test_an_alarm_ends_only_when_the_value_has_stayed_normal() -> None:
    """A value that comes and goes within the off-delay is one alarm, not many."""
    limits = AlarmLimits(high=80, off_delay_s=5)
    found = alarms(limits, (0, 85), (1, 70), (3, 85), (4, 70), (8.9, 70), (9, 70), (10, 85))
    assert found == ["high", "high", "high", "high", "high", "", "high"]


def test_an_alarm_ends_without_a_further_reading() -> None:
    """The end of the off-delay is a deadline, as the end of the on-delay is."""
    made = readings(Signal("v", limits=AlarmLimits(high=80, off_delay_s=5), stale_after_s=3))
    made.set_values({"v": 85}, 0)
    made.set_values({"v": 70}, 2)
    assert made.deadline == 7
    assert made.tick(6.9) == []
    assert [sample.alarm for sample in made.tick(7)] == [""]
    assert made.deadline is None


def test_both_ends_of_an_array_may_be_past_their_limits() -> None:
    """The lesser alarm has begun as well, so no deadline is left that would never pass."""
    limits = AlarmLimits(lolo=10, hihi=90, for_s=1)
    made = readings(Signal("cells", "array", limits=limits, stale_after_s=3))
    made.set_values({"cells": [5, 95]}, 0)
    assert [sample.alarm for sample in made.tick(1)] == ["lolo"]
    assert made.deadline is None


def test_a_state_is_an_alarm_or_a_warning_by_its_priority() -> None:
    """A boolean, a word and a number of a fault code."""
    fault = AlarmAttributes(priority="high")
    words = AlarmLimits(states=("stopped", "reduced"), attributes=(("stopped", fault),))
    made = readings(
        Signal("mode", "string", limits=words),
        Signal("bump", "boolean", limits=AlarmLimits(states=("true",))),
        Signal("code", "integer", limits=AlarmLimits(states=("3", "-1"))),
        Signal("modes", "array", items="string", limits=words),
    )
    turns = (
        ("mode", "ready", ""), ("mode", "reduced", "minor"), ("mode", "stopped", "major"),
        ("mode", "ready", ""), ("bump", False, ""), ("bump", True, "minor"), ("code", 2, ""),
        ("code", 3, "minor"), ("code", -1, "minor"), ("modes", ["ready", "stopped"], "major"),
    )  # fmt: skip
    for now, (name, value, alarm) in enumerate(turns):
        ((sample,), refused) = made.set_values({name: value}, now)
        assert (sample.alarm, refused) == (alarm, []), (name, value)


def test_a_value_that_is_not_available_has_no_alarm() -> None:
    """Nothing can be judged, so an off-delay does not hold the alarm either."""
    limits = AlarmLimits(high=80, states=("7",), off_delay_s=5)
    assert alarms(limits, (0, 85), (1, None), (2, 7)) == ["high", "", "minor"]


def test_an_alarm_begins_without_a_further_reading() -> None:
    """A robot that tells only what changes would never be told of otherwise."""
    made = readings(VOLTS)
    made.set_values({"volts": 11}, 5.0)
    assert made.deadline == 8.0
    assert made.tick(7.9) == []
    assert made.tick(8.0) == [Sample("volts", 11, 5.0, "low")]
    assert made.deadline is None


def test_an_array_is_judged_by_its_worst_element() -> None:
    """One cell that is flat is a flat battery."""
    made = readings(Signal("cells", "array", limits=AlarmLimits(low=3.2, high=4.3)))
    assert made.set_values({"cells": [3.9, 3.1, None]}, 0.0)[0][0].alarm == "low"
    assert made.set_values({"cells": [3.9, 4.4]}, 1.0)[0][0].alarm == "high"
    assert made.set_values({"cells": [None]}, 2.0)[0][0].alarm == ""


def test_a_computed_signal_follows_each_of_its_inputs() -> None:
    """It waits until each has been read once."""
    made = readings(signal("power", "volts * amps"), signal("volts"), signal("amps"))
    assert values(made.set_values({"volts": 12}, 0.0)[0]) == {"volts": 12}
    assert values(made.set_values({"amps": 2}, 1.0)[0]) == {"amps": 2, "power": 24}
    assert values(made.set_values({"volts": 11}, 2.0)[0]) == {"volts": 11, "power": 22}


def test_computed_signals_may_rest_on_computed_ones_in_any_order() -> None:
    """And on settings."""
    made = readings(
        signal("left", "energy / settings.cells"), signal("energy", "volts * 2"), signal("volts")
    )
    assert values(made.set_values({"volts": 10}, 0.0)[0]) == {"volts": 10, "energy": 20, "left": 5}


def test_what_is_computed_from_nothing_available_is_not_available() -> None:
    """Unless the expression says what to do then."""
    made = readings(
        signal("double", "volts * 2"), signal("safe", "(volts | default(0)) + 1"), signal("volts")
    )
    samples, refused = made.set_values({"volts": None}, 0.0)
    assert values(samples) == {"volts": None, "double": None, "safe": 1}
    assert refused == []


def test_a_formula_that_fails_is_told() -> None:
    """Counted like any value that is none; the input itself is taken."""
    made = readings(signal("inverse", "1 / volts", max=5), signal("volts"))
    samples, refused = made.set_values({"volts": 0}, 0.0)
    assert values(samples) == {"volts": 0}
    assert refused == ["inverse: in '1 / volts': division by zero"]
    assert made.set_values({"volts": 0.1}, 1.0)[1] == ["inverse: 10 is above its maximum 5"]


def test_a_computed_signal_is_as_old_as_the_first_of_its_inputs_to_grow_old() -> None:
    """It never looks fresh over a dead input."""
    made = readings(
        signal("power", "volts * amps", stale_after_s=3.0),
        signal("volts", stale_after_s=3.0),
        signal("amps", stale_after_s=60.0),
    )
    made.set_values({"volts": 12}, 0.0)
    made.set_values({"amps": 1}, 1.0)
    power = made.set_values({"amps": 2}, 50.0)[0][1]
    assert power.time_s == 0.0  # old at 3.0, when volts is
    power = made.set_values({"volts": 12}, 100.0)[0][1]
    assert power.time_s == 100.0  # fresh: amps is good until 110
    power = made.set_values({"volts": 12}, 109.0)[0][1]
    assert power.time_s == 107.0  # old at 110, when amps is


def test_a_computed_signal_has_its_own_limits() -> None:
    """With the newest values of its inputs."""
    made = readings(signal("power", "volts * 2", limits=AlarmLimits(high=10)), signal("volts"))
    assert made.set_values({"volts": 6}, 0.0)[0][1] == Sample("power", 12, 0.0, "high")


def test_orientation_to_angles() -> None:
    """A quaternion signal and a computed heading."""
    made = readings(
        Signal("turn", "array", size=4, stale_after_s=1),
        signal("heading", "(turn | yaw) * 180 / 3.141592653589793"),
    )
    samples = made.set_values({"turn": [0, 0, 1, 1]}, 0.0)[0]
    assert round(samples[1].value, 6) == 90.0  # type: ignore[arg-type]
    assert values(made.set_values({"turn": [0, 0, 0, 0]}, 1.0)[0])["heading"] is None


def test_a_frame_that_two_kinds_set_shares_the_alarm() -> None:
    """The state belongs to the signal, not to the frame."""
    made = readings(Signal("v", limits=AlarmLimits(low=20, hysteresis=2)))
    first, second = made.decoder(("v",)), made.decoder(("v", "_x"))
    assert first({"v": 19}, 0.0)[0][0].alarm == "low"
    assert second({"v": 21, "_x": 1}, 1.0)[0][0].alarm == "low"


def test_conversions_and_refusals_of_a_frame() -> None:
    """One bad value does not spoil the others."""
    made = readings(Signal("a", conversion=Conversion(polynomial=(0, 0.1))), Signal("b", max=1))
    samples, refused = made.set_values({"a": "3", "b": 2}, 0.0)
    assert (values(samples), refused) == ({"a": 0.3}, ["b: 2 is above its maximum 1"])


@pytest.mark.parametrize(
    ("said", "value"),
    [
        ("T 9.9E37", None),
        ("T +9.90000E+37", None),
        ("T 9.8E37", 9.8e37),
        ('{"t": 99e36}', None),
        ('{"t": 98e36}', 98e36),
        ("T 000", None),
        ("T 0", 0),
        ("W 9.9E37", None),
        ("W +9.90000E+37", "+9.90000E+37"),
    ],
)
def test_number_in_quotes_that_means_no_value(said: str, value: object) -> None:
    """It is that number however it is spelt, or exact text where that begins with zeros."""
    talk = Dialogue(
        """
signals:
  t: { not_available: ["9.9E37", "000"] }
  w: { type: string, not_available: ["9.9E37"] }
messages:
  t: { regex: '^T (?P<t>.+)$' }
  j: { json: { t: t } }
  w: { regex: '^W (?P<w>.+)$' }
"""
    ).connect()
    talk.says(said)
    assert list(talk.values.values()) == [value]
    assert talk.faults == []


NEVER_READ = """
signals:
  a: { type: integer }
  b: { type: integer }
  either: { value: "(a | default(7)) + b" }
  both: { value: "(a | default(7)) + a + b" }
  nested: { value: "((a + 1) | default(0)) + b" }
messages: { a: { regex: '^a(?P<a>\\d+)$' }, b: { regex: '^b(?P<b>\\d+)$' } }
"""


def test_a_default_stands_for_what_was_never_read() -> None:
    """Until it is read; a value that is used without a default as well is waited for."""
    talk = Dialogue(NEVER_READ).connect()
    talk.says("b3")
    assert talk.values == {"b": 3, "either": 10, "nested": 3}
    talk.says("a1")
    assert talk.values == {"a": 1, "b": 3, "either": 4, "both": 5, "nested": 5}
