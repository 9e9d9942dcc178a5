"""Replies to the probe for ONVIF cameras, right and wrong ones."""

import pytest

from urc.transports.discover_onvif import CameraAnnouncement, matches

MESSAGE = "urn:uuid:0a6dc791-2be6-4991-9af1-454778a1917a"
REPLY = """<?xml version="1.0" encoding="UTF-8"?>
<SOAP-ENV:Envelope xmlns:SOAP-ENV="http://www.w3.org/2003/05/soap-envelope"
 xmlns:wsa="http://schemas.xmlsoap.org/ws/2004/08/addressing"
 xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery"
 xmlns:dn="http://www.onvif.org/ver10/network/wsdl">
<SOAP-ENV:Header><wsa:RelatesTo>{relates}</wsa:RelatesTo></SOAP-ENV:Header>
<SOAP-ENV:Body><d:ProbeMatches><d:ProbeMatch>
<d:Types>dn:NetworkVideoTransmitter</d:Types><d:Scopes>{scopes}</d:Scopes>
<d:XAddrs>{places}</d:XAddrs></d:ProbeMatch></d:ProbeMatches></SOAP-ENV:Body>
</SOAP-ENV:Envelope>"""
PLACE = "http://192.168.1.64/onvif/device_service"
CAMERA = CameraAnnouncement("192.168.1.64", 80, "/onvif/device_service", "ACME Dome D7")
SCOPES = (
    "onvif://www.onvif.org/type/ptz onvif://www.onvif.org/name/ACME%20Dome "
    "onvif://www.onvif.org/hardware/D7"
)


def reply(relates: str = MESSAGE, scopes: str = SCOPES, places: str = PLACE) -> bytes:
    return REPLY.format(relates=relates, scopes=scopes, places=places).encode()


def test_a_reply_names_the_camera_and_its_service() -> None:
    assert list(matches(reply(), MESSAGE)) == [CAMERA]


def test_each_address_of_a_camera_counts() -> None:
    found = list(matches(reply(places=f"{PLACE} https://[fd00::64]:8443/onvif/"), MESSAGE))
    assert found == [CAMERA, CameraAnnouncement("fd00::64", 8443, "/onvif/", "ACME Dome D7")]


def test_a_camera_may_have_no_name() -> None:
    assert list(matches(reply(scopes=""), MESSAGE)) == [CAMERA._replace(name="")]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff\xfe",
        b"<a>",
        reply(relates="urn:uuid:another"),
        reply(places=""),
        reply(places="ftp://192.168.1.64/ http://:80/ http://[::1 http://h:99999/"),
        b"<!DOCTYPE a [<!ENTITY b 'c'>]>" + reply().partition(b"?>")[2],
        b"<a>" * 20_000 + b"</a>" * 20_000,
    ],
    ids=["empty", "no text", "cut", "another probe", "no address", "wrong", "entities", "deep"],
)
def test_a_wrong_reply_names_no_camera(data: bytes) -> None:
    assert list(matches(data, MESSAGE)) == []
