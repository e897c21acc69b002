"""What the dissector must show for the lines of `axle decode --json`."""
import struct
from collections import Counter

XYZ = ("x", "y", "z")
PARTS = {"rpm": ("front_left", "front_right", "back_left", "back_right"), "acc": XYZ, "gyro": XYZ,
         "mag": XYZ, "acc_bias": XYZ, "gyro_bias": XYZ, "mag_bias": XYZ}
# Keys of a frame that are not in a field of the dissector: what Wireshark itself shows.
OF_WIRESHARK = {"event", "t", "interface", "direction"}
ANSWERS = {"ping": "pong", "calibration_start": "calibration_start_ack",
           "calibration_end": "calibration_end_ack", "imu_bias": "imu_bias_ack",
           "mag_bias": "mag_bias_ack", "bias_request": "biases", "ota_request": "ota_ack"}
REPLY_WINDOW_US, BYTE_US = 20_000, 20
UCP_PATIENCE_US = 1_000_000
# Frames of the master whose echo may still come.
MOST_ECHOES = 16
# The least length of a body with which the host sends an id; id 5 it never sends.
LEAST_OF_HOST = {1: 0, 2: 16, 3: 1, 4: 1, 6: 1, 7: 1, 8: 19, 9: 2, 10: 1}
FROM_HOST = {"ping", "motor_control", "calibration_start", "calibration_end", "imu_bias_ack",
             "mag_bias_ack", "biases", "ota_request", "network_state"}
MEANINGS = {"header": "no frame starts here", "length": "invalid length",
            "id": "invalid node id", "crc": "damaged, or not a frame",
            "idle": "truncated at the end"}
# Values in words: words for numbers, a factor with the form of the product, or a unit.
RESULTS = {0: "fine", 1: "damaged"}
WORDS = {"err": RESULTS, "type": {1: "magnetometer", 2: "IMU"}, "front_led": {0: "off", 100: "on"},
         "state": {0: "unknown", 1: "SIM absent", 2: "disconnected", 3: "connected",
                   4: "firmware update"}}
OTA_RESULTS = {0: "accepted", 1: "failed", 2: "forbidden"}
SCALES = {"acc": (1 / 16384, "{:.4f} g"), "acc_bias": (1 / 16384, "{:.4f} g"),
          "gyro": (1 / 16.4, "{:.2f} °/s"), "gyro_bias": (1 / 16.4, "{:.2f} °/s"),
          "voltage_dv": (0.1, "{:.1f} V"), "current_ca": (0.01, "{:.2f} A")}
UNITS = {"rpm": " 1/min", "heading": "°", "battery_pct": " %", "power_w": " W", "speed": " %",
         "angular": " %"}


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
    """The time; 0 if there is none."""
    if "t" not in row:
        return 0
    whole, fraction = f"{row['t']:.6f}".split(".")
    return 1_000_000 * int(whole) + int(fraction)


def word(message, key, number):
    """What is written behind a number, or instead of it; None if nothing is."""
    if key in SCALES:
        factor, form = SCALES[key]
        return form.format(number * factor)
    words = OTA_RESULTS if (message, key) == ("ota_ack", "err") else WORDS.get(key, {})
    return words.get(number)


def pieces(row):
    """The text of a frame without its exchange: the head, and the values in words in any order."""
    if row["protocol"] == "ucp":
        head = f"{row['message']}, index {row['index']}"
        if row["message"] == "unknown":
            return head, [f"id {row['id']}", f"body {row['body']}"]
        return head, [said(row["message"], key, value) for key, value in row.items()
                      if key not in OF_WIRESHARK | OF_FRAME]
    head = f"{row['message']}, node {row['node']}"
    shows = row.get("mode") if row["message"] == "write" else row["message"].split("_")[0]
    if row["message"] == "write" and not shows:
        return head, [row["payload"]]
    listed = [values if isinstance(values, list) else [values] for values in
              (row.get("rps", []), row.get("count", []), row.get("rotation", []))]
    if shows == "velocity":
        return head, [f"{struct.unpack('<f', struct.pack('<f', float(rps)))[0]:.2f} rps"
                      for rps in listed[0]]
    return head, [f"{rotation + count / 8192:.4f} turns"
                  for count, rotation in zip(listed[1], listed[2], strict=True)]


def words(row):
    """Of each field with values in words: what is written behind the number or before it."""
    if row.get("protocol") != "ucp":
        return {}
    found = {}
    for key, value in row.items():
        parts = PARTS[key] if isinstance(value, list) else [None]
        for part, number in zip(parts, value if isinstance(value, list) else [value]):
            text = word(row["message"], key, number) if isinstance(number, int) else None
            if text is not None:
                found[f"{row['message']}.{key}" + (f".{part}" if part else "")] = text
    return found


def said(message, key, value):
    numbers = value if isinstance(value, list) else [value]
    words = [word(message, key, number) or str(number) for number in numbers]
    return f"{key} {' '.join(words)}{UNITS.get(key, '')}"


OF_FRAME = {"offset", "length", "protocol", "message", "id", "index", "bytes", "layout",
            "state_width"}


def is_text(row, facts, text):
    """Whether this is the text of a frame or gap."""
    if row["event"] == "skipped":
        bytes = "byte" if row["length"] == 1 else "bytes"
        return text == (f"{row['length']} {bytes} skipped: {row['reason']}, "
                        f"{MEANINGS[row['reason']]}")
    took = dict(fact for fact in facts if isinstance(fact, tuple)).get("took")
    suffix = "" if took is None else f" ({took} µs)"
    suffix += " (echo)" if ("echo", True) in facts else ""
    head, values = pieces(row)
    if not text.endswith(suffix):
        return False
    shown_head, _, shown = text[:len(text) - len(suffix)].replace("-nan", "nan").partition(": ")
    return shown_head == head and Counter(shown.split(", ")) == Counter(values or [""])


def addresses(row):
    """Sender and receiver, for the columns; none if they are not known."""
    if row["protocol"] == "ucp":
        if row["message"] == "unknown":
            return None
        return ("host", "robot") if row["message"] in FROM_HOST else ("robot", "host")
    node = f"node {row['node']}"
    if row["message"] in ("write", "read_request"):
        return "master", node
    return node, "master"


def whose_time(port):
    """Words that must be in the text on whose time it is, by the name of the port."""
    if "USB" in port or "ACM" in port:
        return "the machine behind the USB adapter: up to 16 ms"
    if port.startswith("tcp:"):
        return "the time of the network is in it"
    return "no wire, no adapter" if "pts/" in port else "if the port is a USB adapter"


def exchanges(rows, last, window=REPLY_WINDOW_US):
    """What is known of requests and answers: for each row by number, a set of facts. `last` has
    the last time of each interface."""
    lines = {}
    facts = [set() for _ in rows]
    for number, row in enumerate(rows):
        if row["event"] != "frame":
            continue
        new = {"modes": {}, "open": {}, "asked": None, "requests": [], "heard": 0, "window": window}
        line = lines.setdefault(row.get("interface"), new)
        if row["protocol"] == "ucp":
            of_ucp(number, row, line, facts, rows)
        else:
            of_bus(number, row, line, facts, rows)
    for interface, line in lines.items():
        for asked in [line["asked"], *line["open"].values()]:
            if asked is None or not micros(rows[asked]):
                continue
            patience = UCP_PATIENCE_US
            if rows[asked]["protocol"] != "ucp":
                longest = 16 if rows[asked]["protocol"] == "ikeya-3" else 8
                patience = window + BYTE_US * (rows[asked]["length"] + longest)
            if last[interface] - micros(rows[asked]) > patience:
                facts[asked].add("unanswered")
    return facts


def pair(request, answer, facts, rows):
    """How long an answer took; None if it is not known."""
    facts[answer].add(("request", request))
    facts[request].add(("answer", answer))
    took = micros(rows[answer]) - micros(rows[request])
    if took < 0 or not micros(rows[request]):
        return None
    facts[answer].add(("took", took))
    return took


def odd(speeds):
    return {"nan", "inf", "-inf"} & set(map(str, speeds if isinstance(speeds, list) else [speeds]))


def is_echo(row, line, rows):
    """Whether the adapter hears what it has sent: echoes come in the order of the frames."""
    requests = line["requests"]
    for at in range(max(line["heard"], len(requests) - MOST_ECHOES), len(requests)):
        sent = rows[requests[at]]
        if sent["bytes"] == row["bytes"] and sent.get("direction") != row.get("direction"):
            line["heard"] = at + 1
            return True
    return False


def of_bus(number, row, line, facts, rows):
    asked = line["asked"]
    if row["message"] in ("read_request", "write"):
        if row.get("mode") == "velocity" and odd(row["rps"]):
            facts[number].add("not_a_number")
        if is_echo(row, line, rows):
            facts[number].add(("echo", True))
            return
        line["requests"].append(number)
        if asked is not None:
            facts[asked].add("unanswered")
        answered = row["message"] == "read_request" or row["protocol"] == "ikeya-3"
        line["asked"] = number if answered else None
        return
    mode = row["message"].split("_")[0]
    if line["modes"].setdefault(row["node"], mode) != mode:
        facts[number].add("mode_changed")
    line["modes"][row["node"]] = mode
    if odd(row.get("rps", 0.0)):
        facts[number].add("not_a_number")
    if asked is not None and rows[asked]["node"] == row["node"]:
        took = pair(asked, number, facts, rows)
        wire_time = BYTE_US * (row["length"] + rows[asked]["length"])
        if took is not None and took > line["window"] + wire_time:
            facts[number].add("late")
        line["asked"] = None
    elif asked is not None or line["requests"]:
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
    if name == "report" and row["battery_pct"] > 100:
        facts[number].add("battery")
    # The direction tells the sender, and else the message, if it is a known one.
    is_host = {"in": False, "out": True}.get(row.get("direction"), name in FROM_HOST | {"unknown"})
    if is_host and is_hazard(row):
        facts[number].add("hazard")


def is_hazard(row):
    """Whether a frame of the host harms a shipped robot (rulings U7, U13)."""
    if row["id"] == 5 or row["length"] - 8 < LEAST_OF_HOST.get(row["id"], 0):
        return True
    if row["message"] == "motor_control":
        return not (-100 <= row["speed"] <= 100 and -100 <= row["angular"] <= 100
                    and row["front_led"] in (0, 100)
                    and {0} == {row[name] for name in ("back_led", "version", "reserve1",
                                                       "reserve2")})
    return row["message"] == "ota_request" and row["version"] > 38


def gap_warnings(row, protocol):
    """The warnings of a gap."""
    reasons = row.get("reasons", {row["reason"]: row["length"]})
    warnings = Counter(["bad_crc" if "crc" in reasons else "gap"])
    if protocol == "ucp" and "length" in reasons and row.get("direction") != "in":
        warnings["hazard"] += 1
    return warnings
