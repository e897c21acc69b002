"""UCP: messages, framing, and rulings U1 to U13 as far as a listener sees them."""

from axle_text import fixed, rounded
from axle_wire import WIRES, Request, WireDecoder, crc_fits

SYNC = [0xFD, 0xFF]
# Bytes of a frame that its length field does not count, and the values that the field may have.
OUTSIDE_LEN = 4
SHORTEST, LONGEST = 4, 60
HEADER_LEN, CRC_LEN = 6, 2

# A motor command or an update request with a version above this starts an update (ruling U7).
LAST_HARMLESS_VERSION = 38

REPORT = 5

AXES = ("x", "y", "z")
WHEELS = ("front left", "front right", "back left", "back right")

ERRORS = {0: "fine", 1: "damaged"}
KINDS = {1: "magnetometer", 2: "IMU"}
UPDATES = {0: "accepted", 1: "failed", 2: "forbidden"}
STATES = {0: "unknown", 1: "SIM absent", 2: "disconnected", 3: "connected", 4: "firmware update"}


def word(names, what):
    """The text of a code in a message, and of a value with that code."""
    def name(number):
        return names.get(number, "%s %d" % (what, number))

    return name, lambda number: "%s (%d)" % (names.get(number, "?"), number)


ERR, KIND, UPDATE, STATE = (word(ERRORS, "err"), word(KINDS, "type"), word(UPDATES, "err"),
                            word(STATES, "state"))


def unit(name):
    return lambda number: ("%d %s" % (number, name)).rstrip()


def acceleration(raw):
    return "%.4f g (%d)" % (raw / 16384, raw)


def turning(raw):
    return "%.2f deg/s (%d)" % (raw / 16.4, raw)


class Field:
    """Numbers in a body: their name, bytes each, sign, text with unit, and names of several."""

    def __init__(self, name, code, text=unit(""), parts=("",)):
        self.name, self.text, self.parts = name, text, parts
        self.size, self.is_signed = int(code[1:]) // 8, code[0] == "i"

    def numbers(self, values):
        return [int.from_bytes(bytes(values[at:at + self.size]), "little", signed=self.is_signed)
                for at in range(0, len(values), self.size)]


MOTOR = (
    Field("speed", "i16", unit("%")),
    Field("angular", "i16", unit("%")),
    Field("front led", "i16"),
    Field("back led", "i16"),
    Field("version", "u16"),
    Field("reserve1", "u16"),
    Field("reserve2", "u32"),
)
BATTERY = Field("battery", "u16", unit("%"))
RPM = Field("rpm", "i16", unit("rpm"), WHEELS)
SENSORS = (
    Field("acc", "i16", acceleration, AXES),
    Field("gyro", "i16", turning, AXES),
    Field("mag", "i16", unit("counts"), AXES),
    Field("heading", "i16", unit("deg")),
)
POWER = (
    Field("power", "u8", unit("W")),
    Field("voltage", "u8", lambda raw: fixed(False, raw, 1) + " V"),
    Field("current", "u16", lambda raw: fixed(False, raw, 2) + " A"),
)
IMU = (Field("acc bias", "i16", acceleration, AXES), Field("gyro bias", "i16", turning, AXES))
MAG = (Field("mag bias", "i16", unit("counts"), AXES),)
ERR_FIELD = (Field("err", "u8", ERR[1]),)
KIND_FIELD = (Field("type", "u8", KIND[1]),)


class Message:
    """A message: its name, its fields in their order on the wire, and the names of its answer."""

    def __init__(self, name, is_from_host, fields=(), text=lambda _: ""):
        self.name, self.is_from_host, self.fields, self.text = name, is_from_host, fields, text

    def length(self):
        return sum(field.size * len(field.parts) for field in self.fields)


def motor_text(of):
    lamp = {0: "off", 100: "on"}.get(of["front led"][0], "%d" % of["front led"][0])
    text = "speed %4d %%  angular %4d %%  front led %s" % (of["speed"][0], of["angular"][0], lamp)
    for name in ("back led", "version", "reserve1", "reserve2"):
        if of[name][0]:
            text += "  %s %d" % (name, of[name][0])
    return text + "  (starts a firmware update)" * starts_update(of["version"][0])


def starts_update(version):
    """The robot reads it as an i16."""
    return LAST_HARMLESS_VERSION < version < 0x8000


def report_text(of):
    battery = of["battery"][0]
    text = "battery %3d %%" % battery if battery <= 100 else "battery %d (no percentage)" % battery
    text += "  %s V  %s A  %3d W" % (fixed(False, of["voltage"][0], 1, 4),
                                     fixed(False, of["current"][0], 2, 5), of["power"][0])
    acc = [fixed(raw < 0, rounded(abs(raw) * 100, 16384), 2, 5) for raw in of["acc"]]
    gyro = [fixed(raw < 0, rounded(abs(raw) * 100, 164), 1, 6) for raw in of["gyro"]]
    text += "  rpm " + " ".join("%4d" % rpm for rpm in of["rpm"])
    text += "  acc %s g  gyro %s deg/s" % (" ".join(acc), " ".join(gyro))
    text += "  mag " + " ".join("%5d" % mag for mag in of["mag"])
    text += "  heading %3d deg" % of["heading"][0]
    return text + ("  firmware %d" % of["firmware"][0] if "firmware" in of else
                   "  (document layout)")


def imu_text(of):
    return "acc %s, gyro %s" % (plain(of["acc bias"]), plain(of["gyro bias"]))


def mag_text(of):
    return "mag " + plain(of["mag bias"])


def plain(numbers):
    return " ".join(map(str, numbers))


def code_text(name, code):
    return lambda of: code[0](of[name][0])


def ack_text(of):
    return "%s, %s" % (KIND[0](of["type"][0]), ERR[0](of["err"][0]))


def state_text(width):
    return lambda of: "%s, in %s" % (STATE[0](of["state"][0]), width)


# By id; the length of the body tells those of one id apart (ruling U4).
MESSAGES = {
    1: (Message("ping", True),
        Message("pong", False, ERR_FIELD, code_text("err", ERR))),
    2: (Message("motor_control", True, MOTOR, motor_text),),
    3: (Message("calibration_start", True, KIND_FIELD, code_text("type", KIND)),
        Message("calibration_start_ack", False, KIND_FIELD + ERR_FIELD, ack_text)),
    4: (Message("calibration_end", True, KIND_FIELD, code_text("type", KIND)),
        Message("calibration_end_ack", False, KIND_FIELD + ERR_FIELD, ack_text)),
    5: (Message("report", False, (BATTERY, RPM) + SENSORS + POWER + (Field("firmware", "u16"),),
                report_text),
        Message("report", False, (BATTERY, RPM) + POWER + SENSORS, report_text)),
    6: (Message("imu_bias", False, IMU, imu_text),
        Message("imu_bias_ack", True, ERR_FIELD, code_text("err", ERR))),
    7: (Message("mag_bias", False, MAG, mag_text),
        Message("mag_bias_ack", True, ERR_FIELD, code_text("err", ERR))),
    8: (Message("bias_request", False),
        Message("biases", True, ERR_FIELD + IMU + MAG,
                lambda of: "%s, %s, %s" % (ERR[0](of["err"][0]), imu_text(of), mag_text(of)))),
    9: (Message("ota_request", True, (Field("version", "i16"),),
                lambda of: "version %d" % of["version"][0]),
        Message("ota_ack", False, (Field("err", "u8", UPDATE[1]),), code_text("err", UPDATE))),
    10: (Message("network_state", True, (Field("state", "u8", STATE[1]),), state_text("1 byte")),
         Message("network_state", True, (Field("state", "u32", STATE[1]),), state_text("4 bytes"))),
}

# What is answered by what.
ANSWERS = {
    "ping": "pong",
    "calibration_start": "calibration_start_ack",
    "calibration_end": "calibration_end_ack",
    "imu_bias": "imu_bias_ack",
    "mag_bias": "mag_bias_ack",
    "bias_request": "biases",
    "ota_request": "ota_ack",
}
ANSWERED = {answer: request for request, answer in ANSWERS.items()}


class Decoder(WireDecoder):
    id = "axle_ucp"
    name = "UCP"
    longname = "UCP rover link"
    desc = "Link between the Linux board and the motor board of a rover (axlewire)."
    options = (
        {"id": "host", "desc": "The wire on which the host sends", "default": "unknown",
         "values": ("unknown",) + WIRES},
        WireDecoder.SILENCE,
    )
    annotations = (
        ("byte", "Byte of a frame"),
        ("skipped-byte", "Skipped byte"),
        ("to-robot", "Message to the robot"),
        ("to-host", "Message to the host"),
        ("unknown", "Unknown message"),
        ("value", "Value"),
        ("gap", "Gap"),
        ("answer", "Response time"),
        ("missing", "No answer"),
        ("warning", "Warning"),
    )
    annotation_rows = (
        ("bytes", "Bytes", (0, 1)),
        ("packets", "Packets", (2, 3, 4)),
        ("values", "Values", (5,)),
        ("gaps", "Gaps", (6,)),
        ("responses", "Response times", (7, 8)),
        ("warnings", "Warnings", (9,)),
    )

    def forget(self):
        self.open = {}
        self.last_index = {}

    def judge(self, values):
        """The rule of `src/ucp/framing.rs`."""
        if any(value != sync for value, sync in zip(values, SYNC)):
            return "reject", "header", 1
        if len(values) < 3:
            return "partial", len(values) + 1
        # As long as the second byte is missing, the first may already be wrong.
        length = values[2] | (values[3] << 8 if len(values) > 3 else 0)
        if not SHORTEST <= length <= LONGEST:
            return "reject", "length", 1
        if len(values) < 4:
            return "partial", 4
        length += OUTSIDE_LEN
        if len(values) < length:
            return "partial", length
        return ("frame", length) if crc_fits(values[:length]) else ("reject", "crc", 1)

    def refused(self, wire, skipped, reason, values):
        if reason == "length" and self.may_be_host(wire):
            text = "length below 4 or above 60: hangs or corrupts shipped robots (U2, U13)"
            text += self.condition()
            self.warn(skipped[0].ss, skipped[0].es, text, "length", "!")

    def may_be_host(self, wire):
        return self.options["host"] in ("unknown", WIRES[wire])

    def condition(self):
        """What is a hazard from the host may be none from the robot."""
        return ", if the host sent it" if self.options["host"] == "unknown" else ""

    def is_host(self, wire):
        return self.options["host"] == WIRES[wire]

    def frame(self, wire, frame):
        number, index = frame.values[4:6]
        body = frame.values[HEADER_LEN:-CRC_LEN]
        message = next((message for message in MESSAGES.get(number, ())
                        if message.length() == len(body)), None)
        self.show_bytes(frame, [("sync", 2), ("length", 2), ("id", 1), ("index", 1),
                                ("body", len(body)), ("crc", 2)])
        self.value(frame, 5, 1, "index %d" % index, "%d" % index)
        if message is None:
            self.unknown(wire, frame, number, index, body)
            return
        of = self.fields(frame, message, body)
        contents = message.text(of)
        head = "%s, index %d" % (message.name, index)
        text = head + (": " + contents if contents else "")
        kind = "to-robot" if message.is_from_host else "to-host"
        self.note(kind, frame.ss, frame.es, [text, head, message.name, "%d" % number])
        self.check(wire, frame, message, index, of)
        self.answer(frame, message)

    def unknown(self, wire, frame, number, index, body):
        """An unknown id, or a length of body that no message has (ruling U3)."""
        digits = bytes(body).hex()
        head = "unknown, index %d" % index
        text = "%s: id %d, body %s" % (head, number, digits)
        self.note("unknown", frame.ss, frame.es, [text, head, "id %d" % number, "?"])
        if body:
            self.value(frame, HEADER_LEN, len(body), "body " + digits, "body")
        if number == REPORT and self.may_be_host(wire):
            self.hazard(frame, "id 5 from a host hangs shipped robots (U13)" + self.condition())
        elif number in MESSAGES and self.may_be_host(wire):
            lengths = [message.length() for message in MESSAGES[number] if message.is_from_host]
            if len(body) < min(lengths):
                text = "a body of %d bytes, not %d: shipped robots read what lies behind (U13)"
                self.hazard(frame, text % (len(body), min(lengths)) + self.condition())
        elif bytes(SYNC) in bytes(body) and self.may_be_host(wire):
            text = "another FD FF inside: robots may take it for a frame (U13)"
            self.hazard(frame, text + self.condition())

    def fields(self, frame, message, body):
        """Shows the values of a message, and returns the numbers of each field."""
        of, at = {}, 0
        for field in message.fields:
            length = field.size * len(field.parts)
            numbers = field.numbers(body[at:at + length])
            for place, (part, number) in enumerate(zip(field.parts, numbers)):
                name = (field.name + " " + part).strip()
                text = field.text(number)
                self.value(frame, HEADER_LEN + at + place * field.size, field.size,
                           "%s %s" % (name, text), text, "%d" % number)
            of[field.name] = numbers
            at += length
        return of

    def hazard(self, frame, text):
        self.warn(frame.ss, frame.es, text, "hazard", "!")

    def check(self, wire, frame, message, index, of):
        if message.name == "motor_control":
            self.check_motor(frame, of)
        elif message.name == "ota_request" and of["version"][0] > LAST_HARMLESS_VERSION:
            self.hazard(frame, "version %d starts a firmware update (U7)" % of["version"][0])
        elif message.name == "report":
            self.check_report(wire, frame, index, of)
        elif message.name == "bias_request" and self.is_host(wire):
            self.hazard(frame, "a body of 0 bytes, not 19: shipped robots read what lies behind"
                               " (U13)")
        elif message.name == "network_state" and of["state"][0] not in STATES:
            self.warn(frame.ss, frame.es, "state %d is unknown (U8)" % of["state"][0], "state")
        elif of.get("err", [0])[0] != 0:
            text = "err %d: %s was damaged (U12)"
            if message.name == "ota_ack":
                self.warn(frame.ss, frame.es, "the robot refuses the update", "refused")
            elif message.name != "biases":
                asked = ANSWERED.get(message.name, "the frame")
                self.warn(frame.ss, frame.es, text % (of["err"][0], asked), "err")

    def check_motor(self, frame, of):
        """Ruling U7."""
        for name in ("speed", "angular"):
            if abs(of[name][0]) > 100:
                self.hazard(frame, "%s %d %% is out of range: -100 to 100 (U7)" %
                            (name, of[name][0]))
        if starts_update(of["version"][0]):
            self.hazard(frame, "version %d starts a firmware update (U7)" % of["version"][0])
        elif of["version"][0]:
            self.hazard(frame, "version %d, not 0 (U7)" % of["version"][0])
        for name in ("back led", "reserve1", "reserve2"):
            if of[name][0]:
                self.hazard(frame, "%s %d, not 0 (U7)" % (name, of[name][0]))
        if of["front led"][0] not in (0, 100):
            self.hazard(frame, "front led %d, neither 0 nor 100 (U7)" % of["front led"][0])

    def check_report(self, wire, frame, index, of):
        if self.is_host(wire):
            self.hazard(frame, "id 5 from a host hangs shipped robots (U13)")
        if of["battery"][0] > 100:
            text = "battery %d: not 0 to 100 %% (U5)" % of["battery"][0]
            self.warn(frame.ss, frame.es, text, "battery")
        last = self.last_index.get(wire)
        self.last_index[wire] = index
        if last is not None and index != (last + 1) % 256:
            text = "report %d after %d: reports are missing (U9)" % (index, last)
            self.warn(frame.ss, frame.es, text, "index", "I")

    def answer(self, frame, message):
        if message.name in ANSWERS:
            self.close(message.name, frame.ss)
            self.open[message.name] = Request(message.name, frame)
        request = self.open.pop(ANSWERED.get(message.name), None)
        if request is None:
            return
        samples = frame.ss - request.es
        time = self.time(samples)
        text = "%s answered after %s" % (request.key, time)
        ss, es = min(request.es, frame.ss), max(request.es, frame.ss)
        self.note("answer", ss, max(es, ss + 1), [text, "%s %s" % (request.key, time), time])

    def close(self, name, until):
        """A request that is repeated was not answered."""
        request = self.open.pop(name, None)
        if request is not None:
            self.note("missing", request.es, max(until, request.es + 1),
                      ["%s: no answer" % name, "no answer", "-"])

    def give_up(self, until):
        for name, request in sorted(self.open.items()):
            self.close(name, request.es + 1)
