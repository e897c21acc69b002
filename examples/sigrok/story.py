"""Exchanges and hazards, with the response times and warnings that the decoders must show."""
import struct

from make import answer, read, sealed, ucp

RX, TX = 0, 1
FRAMING = "framing or parity error: is the bit rate right?"
IN_TIME = "node %d: %.1f µs, in time: at most 50 µs (I9)"
LATE = "node %d: %.1f µs, late: more than 50 µs (I9)"
TOO_LATE = "node %d: %.1f µs, after the master's timeout of 500 µs (I7)"
TOO_FAST = "node %d: %.1f µs, too fast: less than 2 µs to turn the line round"
NONE = "node %d: no answer"
ABNORMAL = "node %d: 3 requests in a row without an answer in time: abnormal (I7)"
UNASKED = "node %d answers without a request (I9)"
MODE = "node 1 answers in %s mode, before in %s mode: in doubt (I11)"
START = "version %d starts a firmware update (U7)"
RESERVED = "%s, not 0 (U7)"
SHORT = "a body of %d bytes, not %d: shipped robots read what lies behind (U13)"
LENGTH = "length below 4 or above 60: hangs or corrupts shipped robots (U2, U13)"
FROM_HOST = "id 5 from a host hangs shipped robots (U13)"
INSIDE = "another FD FF inside: robots may take it for a frame (U13)"
IF_HOST = ", if the host sent it"


def ask(node, *texts):
    return TX, 300, read(node), *texts


def reply(node, time, *texts):
    return RX, time, answer(node, 1.0), *texts


def write(node, *speeds):
    return sealed("bb%02x" % node + struct.pack("<%df" % len(speeds), *speeds).hex())


def motor(speed=0, angular=0, front=0, back=0, version=0, first=0, second=0):
    return ucp(2, struct.pack("<4hHHI", speed, angular, front, back, version, first, second))


def report(index, battery=50):
    return ucp(5, struct.pack("<H34x", battery), index)


NAN, INF, POSITION = float("nan"), float("inf"), sealed("560100000000")
# The wire, µs since the last byte on any, bytes, and what is shown then.
BUS = [
    # A response time of 0 to 500 µs, to within a sample.
    *(step for text, times in (
        (IN_TIME, (10, 1.8, 23.4, 49.4, 50, 50.2)), (LATE, (50.6, 71.8, 499.2, 500.2)),
        (TOO_FAST, (0, 1.2, -30, -2))) for time in times
      for step in (ask(1), reply(1, time, text % (1, time)))),
    ask(1), reply(1, 500.8, TOO_LATE % (1, 500.8)),
    ask(1), reply(1, 12_345.6, "node 1: 12.35 ms, after the master's timeout of 500 µs (I7)"),
    ask(1), reply(1, 1500.4, TOO_LATE % (1, 1500.4), ABNORMAL % 1),
    # No answer, until the next request.
    ask(2), ask(3, NONE % 2), reply(3, 30, IN_TIME % (3, 30)),
    # Three that are not answered; an answer in time begins anew.
    ask(5), ask(5, NONE % 5), ask(5, NONE % 5), reply(5, 30, IN_TIME % (5, 30)),
    ask(5), ask(5, NONE % 5), ask(5, NONE % 5), ask(6, NONE % 5, ABNORMAL % 5),
    reply(6, 30, IN_TIME % (6, 30)),
    # Another node answers; the request is still open.
    ask(1), reply(2, 20, "node 2 answers, node 1 was asked (I7)"),
    reply(1, 20, IN_TIME.replace("in time: at most", "late: more than") % (1, 200)),
    reply(1, 20, UNASKED % 1),
    (RX, 20, POSITION, MODE % ("position", "velocity"), UNASKED % 1),
    reply(1, 20, MODE % ("velocity", "position"), UNASKED % 1),
    # The other wire has long been silent.
    (TX, 30_000, read(1)), reply(1, 400, LATE % (1, 400)),
    # Broken rules of the bus.
    (TX, 300, sealed("aa09"), "node 9 with a good CRC: not 1 to 8 (I1)"),
    (TX, 300, sealed("bb000000803f"), "node 0 with a good CRC: not 1 to 8 (I1)"),
    (TX, 300, write(1, NAN), "node 1: NaN rps: a slave refuses it (I4)"),
    (TX, 300, write(1, -INF), "node 1: -inf rps: a slave refuses it (I4)"),
    # Its mode is not known: it may be a position.
    (TX, 300, write(4, NAN)),
    ask(3), (RX, 30, answer(3, INF), IN_TIME % (3, 30), "node 3: inf rps: no speed (I4)"),
    # A receiver hears its own sender: late, several packets at once, and one damaged.
    ask(1), (RX, -80, read(1)), reply(1, 30, IN_TIME % (1, 30)),
    (TX, 300, write(1, 2.0)), ask(1), (RX, 40, write(1, 2.0) + read(1)),
    reply(1, 0, LATE.replace("%.1f", "280.0") % 1),
    ask(3), (RX, -80, read(3)[:3]), ask(4, NONE % 3), (RX, -80, read(4)),
    reply(4, 30, IN_TIME % (4, 30)),
    # Much later it is no echo.
    ask(7), (RX, 25_000, read(7), NONE % 7), (TX, 300, read(8), NONE % 7),
    (RX, 30, read(8)[:3]),
    (TX, 300, read(2), FRAMING, NONE % 8, NONE % 2),
]
LIMITS = [
    ask(1), reply(1, 8, "node 1: 8.0 µs, too fast: less than 10 µs to turn the line round"),
    ask(2), reply(2, 60, "node 2: 60.0 µs, in time: at most 100 µs (I9)"),
    ask(3), reply(3, 150, "node 3: 150.0 µs, late: more than 100 µs (I9)"),
    ask(4), reply(4, 350, "node 4: 350.0 µs, after the master's timeout of 300 µs (I7)"),
]
THREE = [
    # A write is answered (I10), and it is an open request.
    (TX, 300, write(1, 1, 2, 3)),
    (RX, 30, sealed("5501" + struct.pack("<3f", 1, 2, 3).hex()), IN_TIME % (1, 30)),
    (TX, 300, write(3, 1, 2, 3)), (TX, 300, read(1), NONE % 3, NONE % 1),
]
# With one direction alone, no exchange is whole.
ANSWERS_ALONE = [ask(1), reply(1, 30), ask(1), reply(1, 700),
                 (RX, 300, POSITION, MODE % ("position", "velocity"))]
ROVER = [
    # Request and answer, in either direction.
    *(step for name, ask, gives, wire, time in (
        ("ping", ucp(1, b""), ucp(1, b"\0"), TX, 0.5),
        ("calibration_start", ucp(3, b"\1"), ucp(3, b"\1\0"), TX, 41.3),
        ("calibration_end", ucp(4, b"\1"), ucp(4, b"\1\0"), TX, 873.6),
        ("imu_bias", ucp(6, bytes(12)), ucp(6, b"\0"), RX, 0.0),
        ("mag_bias", ucp(7, bytes(6)), ucp(7, b"\0"), RX, 5000.0),
        ("bias_request", ucp(8, b""), ucp(8, bytes(19)), RX, 100.0),
        ("ota_request", ucp(9, b"\x26\0"), ucp(9, b"\0"), TX, 100.0))
      for step in ((wire, 300, ask),
                   (1 - wire, time, gives, "%s answered after %.1f µs" % (name, time)))),
    (TX, 300, ucp(1, b"")), (TX, 300, ucp(1, b""), "ping: no answer"),
    (RX, 12_000, ucp(1, b"\1"), "err 1: ping was damaged (U12)", "ping answered after 12.00 ms"),
    # What the robot says.
    (RX, 300, ucp(9, b"\2"), "the robot refuses the update"),
    (RX, 300, ucp(7, b"\1"), "err 1: mag_bias was damaged (U12)"),
    (RX, 300, report(7)), (RX, 300, report(8, 100)),
    (RX, 300, report(9, 101), "battery 101: not 0 to 100 % (U5)"),
    (RX, 300, report(11), "report 11 after 9: reports are missing (U9)"),
    (RX, 300, report(255), "report 255 after 11: reports are missing (U9)"), (RX, 300, report(0)),
    # What the host must not say (U7).
    *((TX, 300, motor(**of), *texts) for of, *texts in (
        ({"speed": 100, "angular": -100, "front": 100},),
        ({"speed": 101}, "speed 101 % is out of range: -100 to 100 (U7)"),
        ({"angular": -101}, "angular -101 % is out of range: -100 to 100 (U7)"),
        ({"version": 38}, RESERVED % "version 38"),
        ({"version": 39}, START % 39), ({"version": 0x7FFF}, START % 0x7FFF),
        ({"version": 0x8000}, RESERVED % "version 32768"),
        ({"back": 1, "first": 2, "second": 3}, RESERVED % "back led 1", RESERVED % "reserve1 2",
         RESERVED % "reserve2 3"),
        ({"front": 1}, "front led 1, neither 0 nor 100 (U7)"))),
    (TX, 300, ucp(10, b"\4")), (TX, 300, ucp(10, b"\5"), "state 5 is unknown (U8)"),
    (TX, 300, ucp(10, b"\x09\0\0\0"), "state 9 is unknown (U8)"),
    (TX, 300, ucp(9, b"\xd9\xff")),
    (TX, 300, ucp(9, b"\x27\0"), START % 39, "ota_request: no answer"),
    (TX, 300, ucp(2, bytes(17))), (TX, 300, ucp(10, bytes(1))), (TX, 300, ucp(0x20, b"\1\2")),
]


def wires(ending):
    """What is a hazard from the host only, on both wires: of one, or of both if it is not told."""
    return [(wire, 300, data, *([text + ending] if text and (ending or wire == TX) else []))
            for data, text in (
                (ucp(5, bytes(3)), FROM_HOST),
                (ucp(2, bytes(15)), SHORT % (15, 16)),
                (ucp(8, bytes(18)), SHORT % (18, 19)),
                (ucp(10, b""), SHORT % (0, 1)),
                (ucp(0x20, b"\1\xfd\xff\2"), INSIDE),
                (b"\xfd\xff\x3d\0" + bytes(6), LENGTH), (b"\xfd\xff\3\0" + bytes(6), LENGTH),
                (b"\xfd\0", ""))
            for wire in (RX, TX)]


# Name, protocol, number of wires, options of the decoder, steps.
STORIES = [
    ("bus", "ikeya", 2, "", BUS),
    ("one pair", "ikeya", 1, "", BUS[:20]),
    ("limits", "ikeya", 2, ":turnaround_us=10:budget_us=100:timeout_us=300", LIMITS),
    ("three", "ikeya-3", 1, "", THREE),
    ("answers alone", "ikeya", 1, ":direction=to-master", ANSWERS_ALONE),
    ("rover", "ucp", 2, "", ROVER),
    ("host unknown", "ucp", 2, "", wires(IF_HOST)),
    ("host on tx", "ucp", 2, ":host=tx", wires("") + [
        (TX, 300, report(1), FROM_HOST), (RX, 300, report(1)),
        (TX, 300, ucp(8, b""), SHORT % (0, 19)), (RX, 300, ucp(8, b"")),
        (RX, 300, ucp(1, b""), "bias_request: no answer")]),
]
