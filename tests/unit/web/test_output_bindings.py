"""What a page is told of a command that an output is bound to: where values go, what is asked."""

from typing import Any

from urc.expressions import compile_expression
from urc.model.driver import Argument, Command, Driver, TransportSpec
from urc.model.exchange import Confirm
from urc.model.interface import OutputBinding, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.sequence import RunStep, WaitStep
from urc.model.widget import Widget, WidgetPort
from urc.shipped import shipped
from urc.web.show.outputs import output_config

VOLTS = Argument("volts", unit="V", min=0, max=10)
CHANNEL = Argument("channel", "integer", default=1)


def config(command: Command, given: OutputBinding | None = None) -> dict[str, Any]:
    """Return what a page gets for an output that gives one value."""
    port = WidgetPort("change", arguments=("value",))
    widget = Widget("slider", "Slider", shipped("widgets") / "slider", {}, {"change": port})
    use = WidgetUse("slot", "slider", {}, {"change": command.name})
    if given is not None:
        use = use._replace(given={"change": given})
    driver = Driver({"wire": TransportSpec("wire", "tcp")}, {}, commands={command.name: command})
    return output_config(use, "change", widget, driver)


def put(*arguments: Argument, **more: Any) -> Command:
    """Return a command with these arguments."""
    return Command("put", "wire", WriteSpec("text"), {one.name: one for one in arguments}, **more)


def test_the_only_value_goes_to_the_only_argument_that_is_not_set() -> None:
    """Whatever it is called, and as it is: only what is held is scaled."""
    assert config(put(VOLTS))["names"] == {"volts": "value"}
    assert config(put(VOLTS))["ranges"] == {}
    fixed = OutputBinding(fixed={"channel": 2})
    assert config(put(VOLTS, CHANNEL), fixed)["names"] == {"volts": "value"}


def test_between_several_arguments_the_binding_chooses() -> None:
    """Nobody guesses."""
    assert config(put(VOLTS, CHANNEL))["names"] == {}
    chosen = OutputBinding(names={"channel": "value"})
    assert config(put(VOLTS, CHANNEL), chosen)["names"] == {"channel": "value"}


def test_a_page_knows_the_bounds_of_what_it_may_set() -> None:
    """And nothing of what is set already."""
    told = config(put(VOLTS, CHANNEL), OutputBinding(fixed={"channel": 2}))["arguments"]
    assert list(told) == ["volts"]
    assert (told["volts"]["min"], told["volts"]["max"], told["volts"]["unit"]) == (0, 10, "V")


def test_a_page_knows_what_moves_whatever_is_given_to_it() -> None:
    """Where that depends on what somebody chooses, the server says no to the choice."""
    climb = Argument("climb", "boolean")
    stairs = put(climb, moves=True, moves_if=compile_expression("climb"))
    assert config(put(climb, moves=True))["moves"]
    assert not config(stairs)["moves"]
    assert config(stairs, OutputBinding(fixed={"climb": True}))["moves"]
    assert not config(stairs, OutputBinding(fixed={"climb": False}))["moves"]


def test_a_page_knows_what_people_are_asked() -> None:
    """Before the command, and before some of its values; without words it is the title."""
    erase = Argument("what", "string", confirm={"map": Confirm("hazardous", "All maps go", True)})
    asks = config(put(erase, title="Erase", confirm=Confirm()))["asks"]
    assert [(one["argument"], one["value"], one["text"]) for one in asks] == [
        ("", "", "Erase"),
        ("what", "map", "All maps go"),
    ]
    assert [(one["level"], one["isTwoPerson"]) for one in asks] == [
        ("normal", False),
        ("hazardous", True),
    ]


def test_a_page_knows_the_steps_of_a_sequence() -> None:
    """Words that can be translated, with the name in them apart."""
    steps = config(put(steps=(RunStep("arm"), WaitStep(0.5))))["steps"]
    assert steps == [
        {"text": "run {what}", "what": "arm"},
        {"text": "wait {what} s", "what": "0.5"},
    ]
