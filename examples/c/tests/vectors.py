#!/usr/bin/env python3
"""Prints the recorded frames of tests/vectors as tables for vectors.c."""
import json
import pathlib

FOLDER = pathlib.Path(__file__).resolve().parents[3] / "tests/vectors"


def vectors(name):
    return [json.loads(line) for line in (FOLDER / name).read_text().splitlines()]


def three(value):
    values = value if isinstance(value, list) else [value]
    return values + [0] * (3 - len(values))


def row(data, *parts):
    hexed = ",".join(f"0x{byte:02x}" for byte in data)
    listed = ["{" + ",".join(map(str, part)) + "}" if isinstance(part, list) else str(part)
              for part in parts]
    print(f"    {{{{{hexed}}}, {len(data)}, {', '.join(listed)}}},")


print("static const struct motor_vector motors[] = {")
for vector in vectors("ikeya.jsonl"):
    fields = vector["fields"]
    header, node = fields["header"], fields["id"]
    if fields.get("crc_ok") is False:
        result = "AXLE_ERROR_CRC"
    elif header not in (0xAA, 0xBB, 0x55, 0x56):
        result = "AXLE_ERROR_FIELD"
    elif not 1 <= node <= 8:
        result = "AXLE_ERROR_NODE_ID"
    else:
        result = "AXLE_OK"
    bits = [f"{int(str(bits), 16)}u" for bits in three(fields.get("rps_bits", "0"))]
    motor_count = 3 if vector["protocol"] == "ikeya-md-3motor" else 1
    row(bytes.fromhex(vector["hex"]), result, header, node, motor_count,
        int("rps_bits" in fields), bits, int("count" in fields),
        three(fields.get("count", 0)), three(fields.get("rotation", 0)))
print("};\n")

print("static const struct rover_vector rovers[] = {")
for vector in vectors("ucp.jsonl"):
    fields = vector["fields"]
    data = bytes.fromhex(vector["hex"])
    data = data[:len(data) - len(fields.get("trailing_bytes", "")) // 2]
    # Motor commands out of range, those with other fields, and what is only read (rulings U7, U8).
    result = "AXLE_OK"
    if fields["id"] == 2:
        version = fields["version"]
        if 38 < version < 0x8000:
            result = "AXLE_ERROR_STARTS_UPDATE"
        elif max(abs(fields["speed"]), abs(fields["angular"])) > 100:
            result = "AXLE_ERROR_PERCENT"
        elif version or fields["back_led"] or fields["front_led"] not in (0, 100):
            result = "AXLE_ERROR_VALUE"
    elif fields.get("state_width") == 4:
        result = "AXLE_ERROR_VALUE"
    elif "body" in fields:
        result = "AXLE_ERROR_KNOWN_ID"
    row(data, result, fields["id"], fields["index"], fields.get("speed", 0),
        fields.get("angular", 0), fields.get("battery_pct", 0), fields.get("heading", 0),
        fields.get("state", 0), fields.get("type", 0), three(fields.get("acc_bias", 0)))
print("};")
