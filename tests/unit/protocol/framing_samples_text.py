"""Frames of text that carry checksums in places of their own, or spell bytes."""

from tests.unit.protocol.framing_samples_sized import Sample, wire

MARLIN = (
    "{ type: delimiter, tx: LF, rx: LF,"
    " checksum: { algorithm: xor8, as: dec, leading_zeros: false, after: '*' } }"
)
NMEA_WITH_MARK = (
    "{ type: brackets, open: '$', close: CRLF, max: 82,"
    " checksum: { algorithm: xor8, as: HEX, after: '*', optional: true } }"
)
SCIP = (
    "{ type: delimiter, tx: [LF, LF], rx: [LF, LF],"
    " checksum: { algorithm: { fold: sum, mask: 0x3F, add: 0x30 }, each: LF } }"
)

TEXT = [
    Sample(
        "line numbers of printers",
        MARLIN,
        b"N3 T0*57\nN4 G92 E0*67\nN5 G28*22\nN6 G1 F1500.0*82\nN7 G1 X2.0 Y2.0 F3000.0*85\n",
        [b"N3 T0", b"N4 G92 E0", b"N5 G28", b"N6 G1 F1500.0", b"N7 G1 X2.0 Y2.0 F3000.0"],
        "RepRap wiki, G-code: N line number, * checksum",
    ),
    Sample(
        "a mark before the checksum",
        NMEA_WITH_MARK,
        b"$GPGLL,5057.970,N,00146.110,E,142451,A*27\r\n$GPVTG,089.0,T,,,15.2,N,,*7F\r\n",
        [b"GPGLL,5057.970,N,00146.110,E,142451,A", b"GPVTG,089.0,T,,,15.2,N,,"],
        "NMEA 0183 sentences, gpsd's NMEA notes",
    ),
    Sample(
        "a check character behind each line",
        SCIP,
        b"00P\n0CB0U\n0CB1Dh3j0O\n\n",
        [b"00\n0CB0\n0CB1Dh3j0"],
        "Hokuyo, SCIP 2.0; 00P is in the document, the others follow its rule",
    ),
    Sample(
        "hex digits that spell the frame",
        "{ type: brackets, open: ':', close: CRLF, decode: HEX, checksum: { algorithm: lrc } }",
        b":1103006B00037E\r\n:F7031389000A60\r\n",
        [wire("1103006B0003"), wire("F7031389000A")],
        "Modbus over serial line: ASCII mode",
    ),
    Sample(
        "base64 that spells the frame",
        "{ type: delimiter, tx: LF, rx: LF, decode: base64 }",
        b"Zm9vYg==\nZm9vYmE=\n\nZm9vYmFy\n",
        [b"foob", b"fooba", b"", b"foobar"],
        "RFC 4648, test vectors",
    ),
    Sample(
        "xml elements without a root",
        "{ type: xml }",
        b"<getProperties version='1.7'/>"
        b"<setNumberVector device='Telescope' name='COORD'>"
        b'<oneNumber name="RA">5.2</oneNumber><oneNumber name="a>b"/></setNumberVector>'
        b"<message text='</x>'><!-- </message> --><![CDATA[</message>]]></message>",
        [
            b"<getProperties version='1.7'/>",
            b"<setNumberVector device='Telescope' name='COORD'>"
            b'<oneNumber name="RA">5.2</oneNumber><oneNumber name="a>b"/></setNumberVector>',
            b"<message text='</x>'><!-- </message> --><![CDATA[</message>]]></message>",
        ],
        "INDI protocol 1.7; XML 1.0",
    ),
]
