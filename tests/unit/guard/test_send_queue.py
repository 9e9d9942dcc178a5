"""A third-party transport that fails in a way that nobody expects."""

from urc.guard.send_queue import tolerant


def test_a_call_that_succeeds_is_unchanged() -> None:
    reasons: list[str] = []

    def offer(data: bytes, *, is_urgent: bool = False) -> tuple[bytes, bool]:
        return data, is_urgent

    call = tolerant(offer, (b"", False), reasons.append)
    assert call(b"go", is_urgent=True) == (b"go", True)
    assert reasons == []


def test_a_call_that_raises_has_a_result_and_a_reason() -> None:
    reasons: list[str] = []

    def unsent() -> int:
        raise OSError("the port is gone")

    assert tolerant(unsent, 0, reasons.append)() == 0
    assert reasons == ["the transport failed in an unexpected way (OSError: the port is gone)"]
