"""What a step of a sequence is called, for people who watch it.

Floor 5. Pure.
"""

from urc.model.flow import (
    ExpectStep,
    FailStep,
    IfStep,
    PromptStep,
    RepeatStep,
    RunStep,
    SendStep,
    SetStep,
    Step,
    UntilStep,
    WaitStep,
)

__all__ = ["step_words"]


def mark(text: str) -> str:
    """Return the text; it is said by the page, and the catalogues must have it."""
    return text


def step_words(step: Step) -> dict[str, str]:
    """Return a key that can be translated, and what its ``{what}`` is."""
    match step:
        case RunStep(command):
            return {"text": mark("run {what}"), "what": command}
        case SendStep():
            return {"text": mark("send"), "what": ""}
        case ExpectStep():
            return {"text": mark("wait for the answer"), "what": ""}
        case PromptStep():
            return {"text": mark("wait for the prompt"), "what": ""}
        case WaitStep(seconds):
            return {"text": mark("wait {what} s"), "what": f"{seconds:g}"}
        case UntilStep(condition):
            return {"text": mark("wait until {what}"), "what": condition.source}
        case RepeatStep(_, times):
            return {"text": mark("repeat up to {what} times"), "what": str(times)}
        case SetStep(values):
            return {"text": mark("set {what}"), "what": ", ".join(values)}
        case IfStep(condition):
            return {"text": mark("if {what}"), "what": condition.source}
        case FailStep():
            return {"text": mark("fail"), "what": ""}
