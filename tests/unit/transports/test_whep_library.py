"""The insides of aiortc and aioice that URC uses: these tests fail when a new version changes them.

See docs/decisions/0076. A change needs a look at `urc.transports.whep_line` and `whep_receiver`.
"""

import inspect

import aioice
import aiortc.rtcdtlstransport as dtls
import pytest
from aioice.ice import Connection, StunProtocol
from aiortc.rtcrtpreceiver import StreamStatistics
from aiortc.rtp import RtpPacket

from urc.transports.whep_line import CameraLine, DatagramLine
from urc.transports.whep_receiver import WhepReceiver


def names_of(call: object) -> list[str]:
    assert callable(call)
    return list(inspect.signature(call).parameters)


def test_the_dtls_transport_calls_three_methods_of_a_receiver() -> None:
    wanted = {name for name in vars(dtls.RtpReceiver) if name.startswith("_handle")}
    assert wanted == {"_handle_disconnect", "_handle_rtcp_packet", "_handle_rtp_packet"}
    for name in wanted:
        assert names_of(getattr(WhepReceiver, name)) == names_of(getattr(dtls.RtpReceiver, name))


def test_the_dtls_transport_has_the_methods_that_urc_calls() -> None:
    transport = dtls.RTCDtlsTransport
    assert names_of(transport._register_rtp_receiver) == ["self", "receiver", "parameters"]
    assert names_of(transport._send_rtp) == ["self", "data"]
    assert names_of(transport._set_role) == ["self", "role"]
    text = inspect.getsource(transport)
    used = {part.split("(")[0].split(" ")[0] for part in text.split("self.transport.")[1:]}
    assert {name for name in used if name.isidentifier()} <= {"_recv", "_send", "role"}
    assert all(hasattr(DatagramLine, name) for name in ("_recv", "_send", "role"))


@pytest.mark.parametrize("name", ["get_component_candidates", "request_received", "data_received"])
def test_the_replaced_methods_of_ice_exist(name: str) -> None:
    assert names_of(getattr(CameraLine, name)) == names_of(getattr(Connection, name))
    assert CameraLine.__mro__[1] is aioice.Connection


def test_ice_passes_all_datagrams_through_the_replaced_methods() -> None:
    text = inspect.getsource(StunProtocol.datagram_received)
    assert "self.receiver.data_received(data" in text
    assert "self.receiver.request_received(message, addr, self)" in text


def test_statistics_start_with_the_first_packet() -> None:
    statistics = StreamStatistics(90_000)
    statistics.add(RtpPacket(sequence_number=7, timestamp=1))
    assert (statistics.max_seq, statistics.packets_lost, statistics.fraction_lost) == (7, 0, 0)
