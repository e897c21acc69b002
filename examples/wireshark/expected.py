"""What the dissector must show for the lines of `axle decode --json`."""
import struct
from collections import Counter

import corpora

XYZ = ("x", "y", "z")
PARTS = {"rpm": ("front_left", "front_right", "back_left", "back_right"), "acc": XYZ, "gyro": XYZ,
         "mag": XYZ, "acc_bias": XYZ, "gyro_bias": XYZ, "mag_bias": XYZ}
# Keys of a frame that are not in a field of the dissector: what Wireshark itself shows.
OF_WIRESHARK = {"event", "t", "interface", "direction"}
ANSWERS = {"ping": "pong", "calibration_start": "calibration_start_ack",
           "calibration_end": "calibration_end_ack", "imu_bias": "imu_bias_ack",
           "mag_bias": "mag_bias_ack", "bias_request": "biases", "ota_request": "ota_ack"}
REPLY_WINDOW_US, BYTE_US = 20_000, 20


def fields_of(row):
    """Field names with the values that they must have, without the protocol in front."""
    if row["event"] == "skipped":
        wanted = {f"skipped.{key}": row[key] for key in ("offset", "length", "reason")}
        reasons = row.get("reasons", {})
        return wanted | {f"skipped.reasons.{name}": count for name, count in reasons.items()}
    wanted = {}
    for key, value in row.items():
        if key in OF_WIRESHARK:
            continue
        if key in ("offset", "length", "protocol", "message", "id", "index", "bytes", "node"):
            wanted[key] = value
        elif row["protocol"] == "ucp":
            name = f"{row['message']}.{key}"
            if isinstance(value, list):
                parts = zip(PARTS[key], value, strict=True)
                wanted |= {f"{name}.{part}": number for part, number in parts}
            else:
                wanted[name] = value
        elif isinstance(value, list):
            wanted |= {f"motor{motor}.{key}": number for motor, number in enumerate(value, 1)}
        else:
            wanted[key] = value
    return wanted


def is_equal(expected, shown, raw):
    """Whether a field shows this value; `raw` is the bytes behind it, if there are some."""
    if isinstance(expected, float) or expected in ("nan", "inf", "-inf"):
        number = float(expected)
        bits = bytes.fromhex(raw)
        if len(bits) != 4:
            return False
        (found,) = struct.unpack("<f", bits)
        is_nan = number != number
        as_shown = float(shown)
        if is_nan:
            return found != found and as_shown != as_shown
        near = as_shown == found or abs(as_shown - found) <= 1e-5 * abs(found)
        return found == struct.unpack("<f", struct.pack("<f", number))[0] and near
    if isinstance(expected, int):
        return shown.lstrip("-").isdigit() and int(shown) == expected
    return shown.replace(":", "") == expected


def micros(row):
    whole, fraction = f"{row['t']:.6f}".split(".")
    return 1_000_000 * int(whole) + int(fraction)


def exchanges(rows):
    """What is known of requests and answers: for each row by number, a set of facts."""
    lines = {}
    facts = [set() for _ in rows]
    for number, row in enumerate(rows):
        if row["event"] != "frame":
            continue
        line = lines.setdefault(row.get("interface"), {"modes": {}, "open": {}, "asked": None})
        if row["protocol"] == "ucp":
            of_ucp(number, row, line, facts, rows)
        else:
            of_bus(number, row, line, facts, rows)
    return facts


def pair(request, answer, facts, rows):
    took = max(micros(rows[answer]) - micros(rows[request]), 0)
    facts[answer] |= {("took", took), ("request", request)}
    facts[request].add(("answer", answer))
    return took


def of_bus(number, row, line, facts, rows):
    asked = line["asked"]
    if row["message"] in ("read_request", "write"):
        if asked is not None and rows[asked]["bytes"] == row["bytes"] \
                and rows[asked].get("direction") != row.get("direction"):
            return
        if asked is not None:
            facts[asked].add("unanswered")
        line["has_requests"] = True
        answered = row["message"] == "read_request" or row["protocol"] == "ikeya-3"
        line["asked"] = number if answered else None
        speeds = row.get("rps") if isinstance(row.get("rps"), list) else [row.get("rps")]
        if row.get("mode") == "velocity" and {"nan", "inf", "-inf"} & set(map(str, speeds)):
            facts[number].add("not_a_number")
        return
    mode = row["message"].split("_")[0]
    if line["modes"].setdefault(row["node"], mode) != mode:
        facts[number].add("mode_changed")
    line["modes"][row["node"]] = mode
    speeds = row.get("rps", 0.0)
    if {"nan", "inf", "-inf"} & set(map(str, speeds if isinstance(speeds, list) else [speeds])):
        facts[number].add("not_a_number")
    if asked is not None and rows[asked]["node"] == row["node"]:
        took = pair(asked, number, facts, rows)
        if took > REPLY_WINDOW_US + BYTE_US * (row["length"] + rows[asked]["length"]):
            facts[number].add("late")
        line["asked"] = None
    elif asked is not None or line.get("has_requests"):
        facts[number].add("foreign")


def of_ucp(number, row, line, facts, rows):
    name, asked = row["message"], line["open"]
    if name in ANSWERS:
        if name in asked:
            facts[asked[name]].add("unanswered")
        asked[name] = number
    for request, answer in ANSWERS.items():
        if name == answer and request in asked:
            pair(asked.pop(request), number, facts, rows)
    if name == "motor_control":
        version = row["version"] - (row["version"] >> 15 << 16)
        if version > 38 or not (-100 <= row["speed"] <= 100 and -100 <= row["angular"] <= 100):
            facts[number].add("hazard")
    if name == "report" and row.get("direction") == "out":
        facts[number].add("hazard")
    if name == "report" and row["battery_pct"] > 100:
        facts[number].add("battery")
    if name == "unknown" and 1 <= row["id"] <= 10:
        facts[number].add("hazard")


def gap_warnings(row, bytes):
    """The warnings of a gap with these bytes."""
    crc = row["reason"] == "crc" or "crc" in row.get("reasons", {})
    warnings = Counter(["bad_crc" if crc else "gap"])
    reasons = row.get("reasons", {row["reason"]: row["length"]})
    if row["of"] == "ucp" and "length" in reasons and has_long_frame(bytes):
        warnings["hazard"] += 1
    return warnings


def has_long_frame(bytes):
    """Whether there is a frame in it that is longer than a shipped robot bears (ruling U13)."""
    for at in range(len(bytes) - 3):
        length = int.from_bytes(bytes[at + 2:at + 4], "little")
        frame = bytes[at:at + length + 4]
        if bytes[at:at + 2] == b"\xFD\xFF" and length > 60 and len(frame) == length + 4 \
                and corpora.crc(frame[:-2]) == frame[-2:]:
            return True
    return False
