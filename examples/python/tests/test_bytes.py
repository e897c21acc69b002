"""Bytes: the decoder, the CRC, and the builders."""

import struct

import axlewire
import pytest
from axlewire import Decoder, Frame, Gap, ikeya, ucp
from hypothesis import given, settings
from hypothesis import strategies as st

PROTOCOLS = ["ucp", "ikeya", "ikeya-3"]
FRAMES = {
    "ucp": [ucp.ping(), ucp.report(rpm=[1, -2, 3, -4]), ucp.motor_control(30, -5), ucp.biases()],
    "ikeya": [ikeya.read(1), ikeya.velocity(2, 1.5), ikeya.write_position(3, 0.5)],
    "ikeya-3": [ikeya.read(1), ikeya.velocity(2, [1, 2, 3]), ikeya.write_position(3, [1, 2, 3])],
}
# As `read` names them.
READ_AS = {"ucp": "ucp", "ikeya": "ikeya", "ikeya-3": "ikeya-3"}



def lines(protocol):
    """A protocol, and pieces of a stream: noise, frames, cut frames."""
    frame = st.sampled_from(FRAMES[protocol])
    cut = st.tuples(frame, st.integers(1, 40)).map(lambda it: it[0][: it[1]])
    pieces = st.lists(st.one_of(st.binary(max_size=30), frame, cut), max_size=12)
    return st.tuples(st.just(protocol), pieces)


def one(protocol, data):
    (frame,) = Decoder(protocol).feed(data)
    assert (frame.raw, frame.protocol) == (data, protocol)
    return frame


def sums(events):
    frames = [it.raw for it in events if isinstance(it, Frame)]
    return frames, sum(it.length for it in events if isinstance(it, Gap))


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(PROTOCOLS).flatmap(lines), st.lists(st.integers(1, 50), min_size=1))
def test_any_chunks_give_what_one_feed_gives(line, sizes):
    protocol, data = line[0], b"".join(line[1])
    whole, chunked = Decoder(protocol), Decoder(protocol)
    expected, got, at, turn = whole.feed(data), [], 0, 0
    while at < len(data):
        size = sizes[turn % len(sizes)]
        got += chunked.feed(data[at : at + size])
        at, turn = at + size, turn + 1
    assert got == expected
    assert (chunked.counters, chunked.pending) == (whole.counters, whole.pending)
    assert chunked.idle() == whole.idle() and chunked.pending == 0
    count = whole.counters
    assert count["received"] == len(data) == count["framed"] + count["skipped"]


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(PROTOCOLS).flatmap(lines))
def test_read_counts_what_the_decoder_counts(line):
    protocol, data = line[0], b"".join(line[1])
    decoder = Decoder(protocol)
    frames, _ = sums(decoder.feed(data) + decoder.idle())
    capture = axlewire.read(data, protocol=READ_AS[protocol])
    for name in ["received", "frames", "framed", "skipped"]:
        assert capture.summary[name] == decoder.counters[name]
    assert capture.frames["bytes"] == frames


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_after_idle_each_byte_was_in_a_frame_or_a_gap(protocol):
    decoder = Decoder(protocol)
    frames, skipped = sums(decoder.feed(FRAMES[protocol][0] + b"xyz") + decoder.idle())
    assert (len(frames), skipped) == (1, 3)


def test_read_takes_the_names_that_the_decoder_takes():
    for protocol in PROTOCOLS:
        assert axlewire.read(FRAMES[protocol][1], protocol=protocol).summary["frames"] == 1


def naive_crc(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


@given(st.binary(max_size=300))
def test_crc16_is_that_of_modbus(data):
    assert axlewire.crc16(b"123456789") == 0x4B37
    assert axlewire.crc16(data) == naive_crc(data)


@pytest.mark.parametrize("kind", [bytearray, memoryview])
def test_whatever_holds_bytes_is_taken(kind):
    assert axlewire.crc16(kind(b"123456789")) == 0x4B37
    assert len(Decoder("ucp").feed(kind(ucp.ping()))) == 1


I3, BIAS = [1, -2, 32767], {"acc_bias": [1, 2, 3], "gyro_bias": [4, 5, -6]}
REPORT = dict(battery_pct=99, rpm=[1, -2, 3, -4], acc=I3, gyro=[4, 5, 6], mag=[-7, 8, 9])
REPORT |= dict(heading=359, power_w=3, voltage_dv=120, current_ca=45)
SPEEDS, KEPT = dict(speed=100, angular=-100), dict(acc=[1, 2, 3], gyro=[4, 5, -6])
BUILT = [
    (ucp.ping(index=7), "ping", dict(index=7, id=1)),
    (ucp.pong(1), "pong", dict(err=1)),
    (ucp.motor_control(100, -100, True), "motor_control", SPEEDS | dict(front_led=100, version=0)),
    (ucp.calibration_start(2), "calibration_start", dict(id=3)),
    (ucp.calibration_start_ack(1, 3), "calibration_start_ack", dict(err=3)),
    (ucp.calibration_end(1), "calibration_end", dict(id=4)),
    (ucp.calibration_end_ack(2, 1), "calibration_end_ack", dict(err=1)),
    (ucp.report(version=39, index=255, **REPORT), "report", REPORT | dict(version=39, index=255)),
    (ucp.document_report(**REPORT), "report", REPORT | dict(layout="document")),
    (ucp.imu_bias(**KEPT), "imu_bias", BIAS),
    (ucp.imu_bias_ack(1), "imu_bias_ack", dict(err=1)),
    (ucp.mag_bias(I3), "mag_bias", dict(mag_bias=I3)),
    (ucp.mag_bias_ack(2), "mag_bias_ack", dict(err=2)),
    (ucp.bias_request(), "bias_request", dict(id=8)),
    (ucp.biases(**KEPT, mag=I3, err=1), "biases", BIAS | dict(mag_bias=I3, err=1)),
    (ucp.ota_request(-5), "ota_request", dict(version=-5)),
    (ucp.ota_ack(4), "ota_ack", dict(err=4)),
    (ucp.network_state(3), "network_state", dict(state=3)),
    (ucp.unknown(0x50, b"ab", index=3), "unknown", dict(id=0x50, index=3)),
    (ikeya.read(8), "read_request", dict(node=8)),
    (ikeya.write_velocity(1, -1.5), "write", dict(node=1, rps=-1.5)),
    (ikeya.write_position(2, -2.5), "write", dict(node=2, count=-4096, rotation=-2)),
    (ikeya.velocity(3, 0.25), "velocity_response", dict(node=3, rps=0.25)),
    (ikeya.position(4, 1.5), "position_response", dict(node=4, count=4096, rotation=1)),
    (ikeya.write_velocity(5, [1, 2, -3]), "write", dict(node=5, rps=[1, 2, -3])),
    (ikeya.velocity(6, [1, 2, -3]), "velocity_response", dict(node=6, rps=[1, 2, -3])),
    (ikeya.write_position(7, [1, 2, 3.5]), "write", dict(count=[0, 0, 4096], rotation=[1, 2, 3])),
    (ikeya.position(8, [1, -2, 3]), "position_response", dict(rotation=[1, -2, 3])),
]


@pytest.mark.parametrize("data,message,values", BUILT, ids=[it[1] for it in BUILT])
def test_a_builder_makes_its_message_with_its_values(data, message, values):
    bus = "ikeya-3" if len(data) == 16 else "ikeya"
    frame = one("ucp" if data[:2] == b"\xfd\xff" else bus, data)
    assert frame.message == message and frame.fields["bytes"] == data.hex()
    for name, value in values.items():
        assert getattr(frame, name) == frame.fields[name] == value


def test_every_builder_of_ucp_is_in_the_table_above():
    assert {it[1] for it in BUILT} | {"document_report"} >= set(ucp.__all__)


NAN, HUGE = float("nan"), float("inf")
REFUSED = """
ucp.motor_control(101) ucp.motor_control(0,-101) ucp.motor_control(99999) ucp.motor_control(1.5)
ucp.motor_control("1") ucp.network_state(256) ucp.network_state(-1) ucp.ping(index=256)
ucp.pong(256) ucp.report(nope=1) ucp.report(rpm=[1,2,3]) ucp.report(heading=1.5) ucp.unknown(5)
ucp.imu_bias([1,2],I3) ucp.mag_bias([1,2,40000]) ucp.report(acc=[0,0,32768]) ucp.unknown(256)
ucp.unknown(1,b"") ucp.unknown(0x50,bytes(57)) ucp.unknown(0x50,"abc") ikeya.read(0) ikeya.read(9)
ikeya.read(-1) ikeya.write_velocity(1,NAN) ikeya.write_velocity(1,[0,0,HUGE])
ikeya.write_velocity(1,1e39) ikeya.write_velocity(1,[1,2]) ikeya.write_velocity(1,"1")
ikeya.write_position(1,32768) ikeya.write_position(1,NAN) ikeya.velocity(9,1) ikeya.position(0,1)
Decoder("nope") Decoder("ucp").feed("abc") axlewire.crc16("abc") Gap()
"""


@pytest.mark.parametrize("code", REFUSED.split())
def test_wrong_values_are_refused_with_a_clear_error(code):
    with pytest.raises((ValueError, OverflowError, TypeError)) as raised:
        eval(code)
    assert len(str(raised.value)) > 10


def test_frames_and_gaps_match():
    found = []
    for event in Decoder("ucp").feed(b"xy" + ucp.ping() + ucp.motor_control(30, 5)):
        match event:
            case Gap(length, "header"):
                found.append(length)
            case Frame("ping", raw):
                found.append(raw)
            case Frame(message="motor_control", speed=speed, angular=5):
                found.append(speed)
    assert found == [2, ucp.ping(), 30]


def test_equal_frames_and_gaps_are_equal():
    a, b, c = one("ucp", ucp.ping()), one("ucp", ucp.ping()), one("ucp", ucp.ping(index=1))
    assert a == b and hash(a) == hash(b) and a != c and len({a, b, c}) == 2
    assert a != ucp.ping() and a is not None and not a == 5
    assert one("ikeya", ikeya.read(1)) != one("ikeya-3", ikeya.read(1))
    assert "ucp.ping" in repr(a) and "index=0" in repr(a)
    with pytest.raises(AttributeError, match="speed"):
        a.speed
    a, b, c = (Decoder("ucp").feed(noise + ucp.ping())[0] for noise in (b"xy", b"ab", b"x"))
    assert a == b and a != c and repr(a) == "<axlewire.Gap of 2 bytes: header>"


def test_a_frame_has_one_protocol():
    frame = one("ikeya-3", ikeya.velocity(1, [1, 2, 3]))
    assert frame.protocol == frame.fields["protocol"]


def test_gaps_hash():
    assert len({Decoder("ucp").feed(noise + ucp.ping())[0] for noise in (b"xy", b"ab")}) == 1


def test_a_number_that_is_none_is_told_as_the_tool_tells_it():
    for value, told in [(NAN, "nan"), (HUGE, "inf"), (-HUGE, "-inf")]:
        body = b"\x55\x01" + struct.pack("<f", value)
        assert one("ikeya", body + struct.pack("<H", naive_crc(body))).rps == told
