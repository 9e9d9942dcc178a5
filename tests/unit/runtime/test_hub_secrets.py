"""What a robot repeats of a secret is shown to nobody: the hub is where all get it from."""

import base64
import json
from urllib.parse import quote

import pytest

from urc.model.payload import Envelope
from urc.model.values import Sample, Signal
from urc.runtime.hub import Hub, LinkStatus, LogEntry, MotionRecord, Tapped, Traffic
from urc.runtime.redaction import Redactor

WORD = 'pa"ss\\wörd é'
FORMS = {
    "as it is": WORD,
    "in JSON": json.dumps(WORD)[1:-1],
    "in JSON, letters as they are": json.dumps(WORD, ensure_ascii=False)[1:-1],
    "in a URL": quote(WORD, safe=""),
    "in hex": WORD.encode().hex(),
    "in base64": base64.b64encode(b"user:" + WORD.encode() + b":x").decode(),
}


def hub_of(*secrets: str) -> Hub:
    """A hub of a robot with these secrets, and one line that is a stream."""
    names = ("word", "dump", "pose", "pin")
    return Hub({name: Signal(name) for name in names}, Redactor(secrets), ["wire"])


def shown(hub: Hub, *events: Tapped) -> str:
    """Let all of it come in, and return what anybody could be shown of it."""
    with hub.tap(with_traffic=True) as tap:
        for event in events:
            match event:
                case Sample():
                    hub.publish([event])
                case LogEntry():
                    hub.log(event)
                case Traffic():
                    hub.saw(event)
                case LinkStatus():
                    hub.set_link(event)
                case MotionRecord():
                    hub.publish_record(event)
        hub.tell_rest(9.0)
        told = tap.drain()
    wire = b"".join(one.data for one in told if isinstance(one, Traffic)).decode("utf-8", "replace")
    kept = (*hub.notes, *hub.traffic, *hub.links.values(), *hub.changed_since(0))
    texts = [_text(one) for one in (*told, *kept)]
    return "\n".join((wire, *texts, str(hub.readings_since(0))))


def _text(event: Tapped) -> str:
    """Return all the texts of an event, as they are."""
    match event:
        case Sample(value=bytes() as data):
            return data.decode("utf-8", "replace")
        case Sample(value=dict() as found):
            return " ".join((*found, *map(str, found.values())))
        case Sample():
            return str(event.value)
        case Traffic():
            body = "" if event.envelope is None else str(event.envelope.body)
            return event.data.decode("utf-8", "replace") + body
        case LinkStatus():
            return event.address + event.detail
        case LogEntry():
            return event.text
        case MotionRecord():
            return " ".join(map(str, event.arguments.values()))
    return ""


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_secret_is_kept_out_of_all_that_comes_in(form: str) -> None:
    """Readings, the log, states, traffic and motion, in whatever form it is written."""
    data = f"echo {form}\n".encode()
    found = shown(
        hub_of(WORD),
        Sample("word", f"it is {form}", 1.0),
        Sample("dump", data, 1.0),
        Sample("pose", {"in": form, form: 1}, 1.0),
        LogEntry(1.0, "warning", "wire", f"no-match: no declaration matches '{form}'"),
        LinkStatus("wire", "lost", f"tcp {form}", 1.0, f"refused {form}"),
        Traffic(1.0, "wire", "received", data),
        Traffic(1.0, "air", "received", data, Envelope("message", {"topic": "/a"}, form)),
        MotionRecord(1.0, "say", {"word": form}),
    )
    assert form not in found
    assert "it is " in found


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("size", [1, 2, 5, 9])
def test_a_secret_that_comes_in_pieces_is_kept_out(form: str, size: int) -> None:
    """However long it takes: nobody waits for what a recording shows."""
    data = f"a {form} b\n".encode()
    pieces = [data[at : at + size] for at in range(0, len(data), size)]
    assert form not in shown(
        hub_of(WORD), *(Traffic(1.0, "wire", "received", piece) for piece in pieces)
    )


@pytest.mark.parametrize("end", ["...", "'...", "'", "", " …"])
def test_a_secret_that_a_note_cuts_off_is_no_more_shown(end: str) -> None:
    """Faults quote the first letters of what came."""
    note = LogEntry(1.0, "warning", "wire", f"no-match: no declaration matches 'pw hunter2-a{end}")
    found = shown(hub_of("hunter2-and-3"), note)
    assert "hunt" not in found
    assert "no declaration matches 'pw ‹secret›" in found


def test_a_word_that_only_begins_like_a_secret_is_shown() -> None:
    """Where it goes on otherwise."""
    text = "the hunter is gone"
    assert text in shown(hub_of("hunter2-and-3"), LogEntry(1.0, "info", "wire", text))


def test_a_secret_number_is_not_available() -> None:
    """Only the number itself, and only where it has enough digits to be told from others."""
    hub = hub_of("4711", "42")
    hub.publish([Sample("pin", 4711, 1.0), Sample("pose", (42, 4711.0, 14711), 1.0)])
    assert [one.value for one in hub.changed_since(0)] == [None, (42, None, 14711)]


def test_traffic_that_may_begin_a_secret_is_shown_when_nothing_follows() -> None:
    """A letter is no secret."""
    hub = hub_of("hunter2")
    with hub.tap(with_traffic=True) as tap:
        hub.saw(Traffic(1.0, "wire", "received", b"battery low h"))
        assert hub.holds_back
        hub.tell_rest(2.0)
        told = [one.data for one in tap.drain() if isinstance(one, Traffic)]
    assert told == [b"battery low ", b"h"]
    assert not hub.holds_back


def test_a_secret_of_two_letters_blanks_what_it_stands_in_alone() -> None:
    """Nearly every text and picture holds them by chance."""
    hub = hub_of("42")
    picture = bytes(range(256)) * 4 + b"42"
    hub.publish([Sample("dump", picture, 1.0), Sample("word", "PIN 42", 1.0)])
    hub.log(LogEntry(1.0, "info", "wire", "connecting to tcp 10.0.0.1:4242"))
    assert [one.value for one in hub.changed_since(0)] == [picture, "‹secret›"]
    assert hub.notes[0].text == "connecting to tcp 10.0.0.1:4242"
