"""What goes wrong on demand with the emulated robots of a dashboard, by robot and for all."""

from pathlib import Path

import pytest

from urc.cli.error_report import Misuse
from urc.cli.fault_injection import FaultInjector
from urc.config.load import load_profile
from urc.problems import UrcError
from urc.runtime.document_tests import sample_settings
from urc.runtime.registries import built_in_catalog
from urc.simulator.emulated_robot import EmulatedRobot

ROBOTS = Path(__file__).parents[3] / "robots"


def twin_of(name: str) -> EmulatedRobot:
    """Return an emulated robot that ships."""
    profile = load_profile(ROBOTS / f"{name}.yaml", built_in_catalog())
    return EmulatedRobot(profile, sample_settings(profile.settings))


def test_a_fault_is_for_one_robot_or_for_all_that_can_have_it() -> None:
    """The puppet has no world, so its sensors cannot be noisy; the others' can."""
    faulty = FaultInjector(lambda: 1.0)
    puppet, boat = twin_of("puppet"), twin_of("nmea-gps")
    with faulty.watch("puppet", puppet), faulty.watch("nmea-gps", boat):
        assert str(faulty) == "faults: none"
        faulty.begin(["loss=5%", "puppet:silent"])
        faulty.inject("noise=2x")
        assert (puppet.faults, boat.faults) == (("loss=5%", "silent"), ("loss=5%", "noise=2x"))
        assert str(faulty) == "faults: puppet: loss=5%, silent; nmea-gps: loss=5%, noise=2x"
        faulty.mend("puppet")
        assert str(faulty) == "faults: nmea-gps: loss=5%, noise=2x"
        faulty.mend()
        assert (puppet.faults, boat.faults) == ((), ())


def test_a_robot_that_is_emulated_anew_keeps_its_faults() -> None:
    """As when its settings were changed; the newer of two of a kind is the one that counts."""
    faulty = FaultInjector(lambda: 1.0)
    with faulty.watch("puppet", twin_of("puppet")):
        faulty.inject("delay=200ms")
        faulty.inject("puppet:delay=400ms")
    assert str(faulty) == "faults: delay=400ms"
    again = twin_of("puppet")
    with faulty.watch("puppet", again):
        assert again.faults == ("delay=400ms",)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("pupet:silent", "no emulated robot has the name 'pupet'; did you mean 'puppet'?"),
        ("puppet:nosie=2x", "unknown fault 'nosie'; known faults: delay=200ms, loss=5%"),
        ("noise=2x", "fault noise: this robot has no world"),
        ("puppet:stuck=batery", "fault stuck: there is no signal 'batery'; did you mean"),
    ],
)
def test_what_nobody_can_have_is_refused(text: str, told: str) -> None:
    """In one line; at the start it is wrong use."""
    faulty = FaultInjector(lambda: 1.0)
    with faulty.watch("puppet", twin_of("puppet")):
        with pytest.raises(UrcError) as refused:
            faulty.inject(text)
        assert str(refused.value).startswith(told)
        with pytest.raises(Misuse, match="--fault: "):
            faulty.begin([text])
        assert str(faulty) == "faults: none"


def test_typed_lines_are_obeyed_and_answered(capsys: pytest.CaptureFixture[str]) -> None:
    """What means nothing is told, and changes nothing."""
    faulty = FaultInjector(lambda: 1.0)
    with faulty.watch("puppet", twin_of("puppet")), faulty.watch("tello", twin_of("tello")):
        for line in ("fault tello:loss=20%", "", "mend pupet", "break it", "faults", "mend tello"):
            faulty.obey(line)
    said = capsys.readouterr()
    assert said.out == "faults: tello: loss=20%\nfaults: tello: loss=20%\nfaults: none\n"
    assert said.err.splitlines() == [
        "no emulated robot has the name 'pupet'; did you mean 'puppet'?",
        "unknown command 'break it'; expected fault …, mend or faults",
    ]
