"""Exchanges, hazards and values in words, with what Wireshark must show of them, by hand."""
import struct
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "sigrok"))
import make
from make import answer, read, sealed, ucp

IN, OUT, UNKNOWN = 1, 2, 0


def write(node, *speeds):
    return sealed("bb%02x" % node + struct.pack("<%df" % len(speeds), *speeds).hex())


def answer3(node, *speeds):
    return sealed("55%02x" % node + struct.pack("<3f", *speeds).hex())


def motor(speed=0, angular=0, front=0, back=0, version=0, first=0, second=0):
    return ucp(2, struct.pack("<4hHHI", speed, angular, front, back, version, first, second))


REPORT = struct.pack("<H13hBBHH", 200, *range(-6, 7), 12, 119, 204, 38)
FRAME, LONG = ucp(0x42, b""), ucp(0x42, bytes(57))
READ1, SPEED1 = "read_request, node 1", "velocity_response, node 1: 1.50 rps"
STILL = "front_led off, back_led 0, version 0, reserve1 0, reserve2 0"
NO_ACC = "acc_bias 0.0000 g 0.0000 g 0.0000 g, gyro_bias 0.00 °/s 0.00 °/s 0.00 °/s"
ACK = "imu_bias_ack, index 0: err "

# By protocol and port: whose time a response time is, and packets: direction, µs since the one
# before, bytes, the text in the packet list, warnings.
STORY = {
    ("ikeya", "/dev/ttyUSB0"): ("the machine behind the USB adapter: up to 16 ms", [
        (OUT, 1000, read(1), READ1),
        (IN, 900, answer(1, 1.5), SPEED1 + " (900 µs)"),
        (OUT, 1000, read(1), READ1),
        (IN, 20_240, answer(1, 1.5), SPEED1 + " (20240 µs)"),
        (OUT, 1000, read(1), READ1),
        (IN, 20_241, answer(1, 1.5), SPEED1 + " (20241 µs)", "late"),
        (OUT, 1000, read(3), "read_request, node 3"),
        (IN, 500, answer(1, 1.5), SPEED1, "foreign"),
        (IN, 100, sealed("56030500feff"), "position_response, node 3: -1.9994 turns (600 µs)"),
        (IN, 100, sealed("5603f0ff0100"), "position_response, node 3: 0.9980 turns", "foreign"),
        (OUT, 1000, read(4), "read_request, node 4", "unanswered"),
        (OUT, 30_000, read(4), "read_request, node 4"),
        (IN, 50, read(4), "read_request, node 4 (echo)"),
        (IN, 300, answer(4, -0.25), "velocity_response, node 4: -0.25 rps (350 µs)"),
        (OUT, 100, write(1, 2.0), "write, node 1: 2.00 rps"),
        (OUT, 100, write(3, 2.0), "write, node 3: 16384.0000 turns"),
        (OUT, 100, write(7, 2.0), "write, node 7: 00000040"),
        (OUT, 100, read(1), READ1),
        # Echoes of several packets in one piece, the first of them damaged.
        (IN, 300, write(1, 2.5)[:-1] + write(3, 2.0) + write(7, 2.0) + read(1),
         "7 bytes skipped: crc, damaged, or not a frame; write, node 3: 16384.0000 turns (echo); "
         "write, node 7: 00000040 (echo); read_request, node 1 (echo)", "bad_crc"),
        (IN, 100, sealed("560101000200"), "position_response, node 1: 2.0001 turns (400 µs)",
         "mode_changed"),
        (OUT, 100, write(4, float("nan")), "write, node 4: nan rps", "not_a_number"),
        (IN, 100, answer(5, float("inf")), "velocity_response, node 5: inf rps", "foreign",
         "not_a_number"),
        (IN, 100, sealed("550900000000"), "8 bytes skipped: id, invalid node id", "gap"),
        (OUT, 1000, read(8), "read_request, node 8", "unanswered"),
        (IN, 50_000, answer(2, 0.5)[:5], "5 of 8 bytes of a frame"),
        (IN, 100, answer(2, 0.5)[5:], "velocity_response, node 2: 0.50 rps", "foreign"),
    ]),
    ("ikeya-3", "/dev/pts/3"): ("no wire, no adapter", [
        (OUT, 100, write(1, 1.0, 2.0, -3.5), "write, node 1: 0000803f00000040000060c0"),
        (IN, 20_641, answer3(1, 1.0, 2.0, -3.5),
         "velocity_response, node 1: 1.00 rps, 2.00 rps, -3.50 rps (20641 µs)", "late"),
        (OUT, 100, read(1), READ1),
        (IN, 20_400, answer3(1, 1.0, 2.0, -3.5),
         "velocity_response, node 1: 1.00 rps, 2.00 rps, -3.50 rps (20400 µs)"),
        (OUT, 100, write(1, 0.5, 2.0, -3.5), "write, node 1: 0.50 rps, 2.00 rps, -3.50 rps",
         "unanswered"),
        (OUT, 700, read(2), "read_request, node 2"),
        (IN, 400, sealed("5602" + struct.pack("<6h", 1, 2, 3, -4, -5, -6).hex()),
         "position_response, node 2: -3.9999 turns, -4.9998 turns, -5.9996 turns (400 µs)"),
    ]),
    ("ikeya", "tcp:bridge:7000"): ("the time of the network is in it", [
        (OUT, 100, read(1), READ1),
        (IN, 3 * 3600 * 1_000_000, answer(1, 1.5), SPEED1 + " (10800000000 µs)", "late"),
        (OUT, 100, read(1), READ1),
        # The clock was set back.
        (IN, -500_000, answer(1, 1.5), SPEED1),
    ]),
    ("ucp", "COM3"): ("if the port is a USB adapter", [
        (IN, 100, ucp(8, b""), "bias_request, index 0"),
        (OUT, 2000, ucp(8, bytes(range(19))),
         "biases, index 0: err fine, acc_bias 0.0313 g 0.0627 g 0.0941 g, gyro_bias 125.30 °/s "
         "156.65 °/s 187.99 °/s, mag_bias 3597 4111 4625 (2000 µs)"),
        (OUT, 100, ucp(1, b"", 1), "ping, index 1", "unanswered"),
        (OUT, 900_000, ucp(1, b"", 2), "ping, index 2"),
        (IN, 1500, ucp(1, b"\0"), "pong, index 0: err fine (1500 µs)"),
        (OUT, 10, ucp(3, b"\1"), "calibration_start, index 0: type magnetometer"),
        (IN, 800, ucp(3, b"\1\0"),
         "calibration_start_ack, index 0: type magnetometer, err fine (800 µs)"),
        (OUT, 10, ucp(4, b"\2"), "calibration_end, index 0: type IMU"),
        (IN, 800, ucp(4, b"\2\1"), "calibration_end_ack, index 0: type IMU, err damaged (800 µs)"),
        (IN, 10, ucp(6, bytes(12)), "imu_bias, index 0: " + NO_ACC),
        (OUT, 20, ucp(6, b"\0"), ACK + "fine (20 µs)"),
        (OUT, 20, ucp(6, b"\2"), ACK + "2"),
        (IN, 10, ucp(7, bytes(6)), "mag_bias, index 0: mag_bias 0 0 0"),
        (OUT, 20, ucp(7, b"\1"), "mag_bias_ack, index 0: err damaged (20 µs)"),
        (OUT, 10, ucp(9, b"\xfe\xff"), "ota_request, index 0: version -2", "unanswered"),
        (OUT, 10, ucp(9, b"\x26\0"), "ota_request, index 0: version 38", "unanswered"),
        (OUT, 10, ucp(9, b"\x27\0"), "ota_request, index 0: version 39", "hazard"),
        (IN, 400_000, ucp(9, b"\2"), "ota_ack, index 0: err forbidden (400000 µs)"),
        (IN, 10, ucp(9, b"\1"), "ota_ack, index 0: err failed"),
        (IN, 10, ucp(9, b"\0"), "ota_ack, index 0: err accepted"),
        (IN, 100, ucp(5, REPORT, 9),
         "report, index 9: battery_pct 200 %, rpm -6 -5 -4 -3 1/min, power_w 254 W, "
         "voltage_dv 25.5 V, current_ca 655.35 A, acc 0.0000 g 0.0001 g 0.0001 g, "
         "gyro 0.18 °/s 0.24 °/s 0.30 °/s, mag 6 30476 204, heading 38°", "battery"),
        (OUT, 100, ucp(5, b"\1"), "unknown, index 0: id 5, body 01", "hazard"),
        (IN, 100, ucp(5, b"\1"), "unknown, index 0: id 5, body 01"),
        (UNKNOWN, 100, ucp(5, b"\1"), "unknown, index 0: id 5, body 01", "hazard"),
        (OUT, 10, motor(100, -100, 100), "motor_control, index 0: speed 100 %, angular -100 %, "
         + STILL.replace("off", "on")),
        (OUT, 10, motor(101), "motor_control, index 0: speed 101 %, angular 0 %, " + STILL,
         "hazard"),
        (IN, 10, motor(101), "motor_control, index 0: speed 101 %, angular 0 %, " + STILL),
        (OUT, 10, motor(0, -101), "motor_control, index 0: speed 0 %, angular -101 %, " + STILL,
         "hazard"),
        *((OUT, 10, motor(**{field: value}), "motor_control, index 0: speed 0 %, angular 0 %, "
           + STILL.replace(shown + (" off" if field == "front" else " 0"), f"{shown} {value}"),
           "hazard")
          for field, shown, value in (("front", "front_led", 7), ("back", "back_led", 5),
                                      ("version", "version", 1), ("version", "version", 32768),
                                      ("first", "reserve1", 1), ("second", "reserve2", 65536))),
        (OUT, 10, ucp(2, bytes(15)), "unknown, index 0: id 2, body " + 15 * "00", "hazard"),
        (OUT, 10, ucp(2, bytes(17)), "unknown, index 0: id 2, body " + 17 * "00"),
        (OUT, 10, ucp(8, bytes(18)), "unknown, index 0: id 8, body " + 18 * "00", "hazard"),
        (OUT, 10, ucp(8, b""), "bias_request, index 0", "hazard"),
        *((OUT, 10, ucp(10, bytes([state])), "network_state, index 0: state " + name)
          for state, name in enumerate(("unknown", "SIM absent", "disconnected", "connected",
                                        "firmware update", "5"))),
        (OUT, 10, ucp(10, b"\4\0\0\1"), "network_state, index 0: state 16777220"),
        (OUT, 10, ucp(10, b""), "unknown, index 0: id 10, body ", "hazard"),
        (OUT, 10, ucp(0x42, b"hello"), "unknown, index 0: id 66, body 68656c6c6f"),
        # A frame behind each ends the gap.
        *((way, 10, bad + FRAME, f"{len(bad)} bytes skipped: {why}; unknown, index 0: id 66, body ",
           *warnings, *["hazard"] * (is_hazard and way != IN))
          for bad, why, is_hazard, *warnings in (
              (b"\xFD\xFF\3\0", "length, invalid length", True, "gap"),
              (LONG, "length, invalid length", True, "gap"),
              (b"\1\2" + LONG, "header, no frame starts here", True, "gap"),
              (b"\1\2", "header, no frame starts here", False, "gap"),
              (FRAME[:-1] + b"\0", "crc, damaged, or not a frame", False, "bad_crc"))
          for way in (IN, OUT, UNKNOWN)),
        (OUT, 10, ucp(1, b"", 3), "ping, index 3"),
        # An answer behind a false header, found at the end only.
        (IN, 100, b"\xFD\xFF\x3C\0" + ucp(1, b"\0", 4),
         "4 bytes skipped: idle, truncated at the end; pong, index 4: err fine (100 µs)", "gap"),
    ]),
}
