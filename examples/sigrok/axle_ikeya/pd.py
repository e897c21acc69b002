"""The Ikeya MD bus: packets, framing and rulings I1 to I11 as far as a listener sees them."""

import struct
from collections import deque

from .axle_wire import Request, WireDecoder, crc_fits, i16
from .axle_text import position_text, shortest

READ, WRITE, VELOCITY, POSITION = 0xAA, 0xBB, 0x55, 0x56
NAMES = {
    READ: "read_request",
    WRITE: "write",
    VELOCITY: "velocity_response",
    POSITION: "position_response",
}
CLASSES = {READ: "read", WRITE: "write", VELOCITY: "velocity", POSITION: "position"}
TO_SLAVE, TO_MASTER = (READ, WRITE), (VELOCITY, POSITION)
HEADERS = {"both": TO_SLAVE + TO_MASTER, "to-slave": TO_SLAVE, "to-master": TO_MASTER}

READ_LEN = 4
LONG = {"one": 8, "three": 16}

# Unanswered requests in a row after which a master takes a node for abnormal (ruling I7).
STRIKES = 3

# An echo begins within this time: a USB adapter that has recorded it may be as late (ruling I7).
ECHO_MS = 20


class Decoder(WireDecoder):
    id = "axle_ikeya"
    name = "Ikeya MD"
    longname = "Ikeya MD motor bus"
    desc = "RS485 motor bus: a master and up to eight motor boards (axlewire)."
    options = (
        {"id": "boards", "desc": "Motors per board (I10)", "default": "one",
         "values": ("one", "three")},
        {"id": "direction", "desc": "Packets to decode", "default": "both",
         "values": ("both", "to-slave", "to-master")},
        {"id": "turnaround_us", "desc": "An answer in less is too fast, µs", "default": 2},
        {"id": "budget_us", "desc": "An answer after more is late (I9), µs", "default": 50},
        {"id": "timeout_us", "desc": "The master's timeout (I7), µs", "default": 500},
        WireDecoder.SILENCE,
    )
    annotations = (
        ("byte", "Byte of a packet"),
        ("skipped-byte", "Skipped byte"),
        ("read", "READ"),
        ("write", "WRITE"),
        ("velocity", "Velocity response"),
        ("position", "Position response"),
        ("value", "Value"),
        ("gap", "Gap"),
        ("in-time", "Answer in time"),
        ("too-fast", "Answer too fast"),
        ("late", "Late answer"),
        ("missing", "No answer"),
        ("warning", "Warning"),
    )
    annotation_rows = (
        ("bytes", "Bytes", (0, 1)),
        ("packets", "Packets", (2, 3, 4, 5)),
        ("values", "Values", (6,)),
        ("gaps", "Gaps", (7,)),
        ("responses", "Response times", (8, 9, 10, 11)),
        ("warnings", "Warnings", (12,)),
    )

    def forget(self):
        self.modes = {}
        self.open = None
        self.strikes = {}
        # What each wire has carried lately, and may still come as an echo on the other.
        self.carried = {0: deque(), 1: deque()}

    def judge(self, values):
        """The rule of `src/ikeya/judge.rs`."""
        if values[0] not in HEADERS[self.options["direction"]]:
            return "reject", "header", 1
        length = READ_LEN if values[0] == READ else LONG[self.options["boards"]]
        if len(values) < length:
            return "partial", length
        if not crc_fits(values[:length]):
            return "reject", "crc", 1
        # Ruling I1: a whole packet for a node that cannot exist.
        return ("frame", length) if 1 <= values[1] <= 8 else ("reject", "id", length)

    def refused(self, wire, skipped, reason, values):
        if reason == "id":
            node = skipped[1].value
            text = "node %d with a good CRC: not 1 to 8 (I1)" % node
            self.warn(skipped[0].ss, skipped[-1].es, text, "node %d" % node)

    def frame(self, wire, frame):
        header, node = frame.values[:2]
        payload = frame.values[2:-2]
        mode = self.modes.get(node)
        parts = [("header", 1), ("node", 1)]
        parts += [(CLASSES[header], len(payload)), ("crc", 2)]
        self.show_bytes(frame, parts)
        self.value(frame, 1, 1, "node %d" % node, "%d" % node)
        contents = self.contents(header, payload, mode)
        head = "%s, node %d" % (NAMES[header], node)
        text = head + (": " + contents if contents else "")
        short = "%s %d" % (CLASSES[header], node)
        self.note(CLASSES[header], frame.ss, frame.es, [text, head, short, short[0].upper()])
        self.values(frame, header, payload, mode)
        if self.is_echo(wire, frame):
            return
        if header in TO_MASTER:
            self.learn(frame, header, node)
        # With one direction alone, no exchange is whole.
        if self.options["direction"] == "both":
            self.exchange(frame, header, node)
        if header == VELOCITY or (header == WRITE and mode == VELOCITY):
            self.check_speeds(frame, header, node, payload)

    def contents(self, header, payload, mode):
        """The text of `axle decode`: in the mode of the node, if that is known (ruling I3)."""
        if header == READ:
            return ""
        speeds = " ".join(map(shortest, speeds_of(payload))) + " rps"
        positions = position_text(*positions_of(payload))
        reading = mode if header == WRITE else header
        if reading == VELOCITY:
            return speeds
        return positions if reading == POSITION else "%s or %s" % (speeds, positions)

    def values(self, frame, header, payload, mode):
        reading = mode if header == WRITE else header
        if header == READ:
            return
        if reading is None:
            self.value(frame, 2, len(payload), self.contents(header, payload, None), "rps or turns")
            return
        if reading == VELOCITY:
            for number, speed in enumerate(speeds_of(payload)):
                text = shortest(speed)
                self.value(frame, 2 + 4 * number, 4, "speed %s rps" % text, "%s rps" % text, text)
            return
        for name, unit, numbers, at in zip(("count", "rotation"), ("counts", "turns"),
                                           positions_of(payload), (2, 2 + len(payload) // 2)):
            for index, number in enumerate(numbers):
                text = "%d %s" % (number, unit)
                self.value(frame, at + 2 * index, 2, "%s %s" % (name, text), text, "%d" % number)

    def check_speeds(self, frame, header, node, payload):
        for speed in speeds_of(payload):
            # Also true of NaN.
            if not abs(speed) < float("inf"):
                does = "a slave refuses it" if header == WRITE else "no speed"
                text = "node %d: %s rps: %s (I4)" % (node, shortest(speed), does)
                self.warn(frame.ss, frame.es, text, "not finite", "!")

    def is_echo(self, wire, frame):
        """Whether the other wire has just carried the same: a receiver hears its own sender. Echoes
        come in order."""
        limit = ECHO_MS * self.samplerate // 1000
        for carried in self.carried.values():
            while carried and frame.ss - carried[0].es > limit:
                carried.popleft()
        other = self.carried[1 - wire]
        for place, sent in enumerate(other):
            if sent.values == frame.values:
                for _ in range(place + 1):
                    other.popleft()
                return True
        self.carried[wire].append(frame)
        return False

    def exchange(self, frame, header, node):
        if header in TO_SLAVE:
            self.request(frame, header, node)
        else:
            self.response(frame, node)

    def request(self, frame, header, node):
        """The master has given up what was open (ruling I7)."""
        self.give_up(frame.ss)
        is_answered = header == READ or self.options["boards"] == "three"
        if is_answered:
            self.open = Request(node, frame)

    def silent(self, since):
        """No answer comes to a request from before."""
        if self.open is not None and self.open.es <= since:
            self.give_up(None)

    def give_up(self, until):
        request, self.open = self.open, None
        if request is None:
            return
        limit = request.es + int(self.options["timeout_us"] * self.samplerate // 1_000_000)
        until = limit if until is None else max(request.es + 1, min(until, limit))
        node = request.key
        self.note("missing", request.es, until,
                  ["node %d: no answer" % node, "no answer", "none", "-"])
        self.strike(node, request.es, until)

    def strike(self, node, ss, es):
        self.strikes[node] = self.strikes.get(node, 0) + 1
        if self.strikes[node] == STRIKES:
            text = "node %d: %d requests in a row without an answer in time: abnormal (I7)"
            self.warn(ss, es, text % (node, STRIKES), "node %d abnormal" % node, "abnormal")

    def response(self, frame, node):
        request = self.open
        if request is None:
            self.warn(frame.ss, frame.es,
                      "node %d answers without a request (I9)" % node, "unasked", "?")
        elif request.key != node:
            text = "node %d answers, node %d was asked (I7)" % (node, request.key)
            self.warn(frame.ss, frame.es, text, "foreign", "?")
        else:
            self.open = None
            self.measure(request, frame, node)

    def measure(self, request, frame, node):
        """The time from the last stop bit of the request to the first start bit of the answer."""
        samples = frame.ss - request.es
        micros, time = self.micros(samples), self.time(samples)
        ss, es = min(request.es, frame.ss), max(request.es, frame.ss)
        budget, timeout = self.options["budget_us"], self.options["timeout_us"]
        fastest = self.options["turnaround_us"]
        # Both edges are known to a sample only.
        slack = self.micros(1)
        in_time = True
        if micros < fastest - slack:
            kind, verdict = "too-fast", "too fast: less than %d µs to turn the line round" % fastest
        elif micros <= budget + slack:
            kind, verdict = "in-time", "in time: at most %d µs (I9)" % budget
        elif micros <= timeout + slack:
            kind, verdict = "late", "late: more than %d µs (I9)" % budget
        else:
            kind, verdict = "late", "after the master's timeout of %d µs (I7)" % timeout
            in_time = False
        text = "node %d: %s, %s" % (node, time, verdict)
        self.note(kind, ss, max(es, ss + 1),
                  [text, "node %d: %s" % (node, time), time, "%d" % round(micros)])
        if in_time:
            self.strikes[node] = 0
        else:
            self.strike(node, frame.ss, frame.es)

    def learn(self, frame, header, node):
        before = self.modes.get(node)
        self.modes[node] = header
        if before not in (None, header):
            words = {VELOCITY: "velocity", POSITION: "position"}
            text = "node %d answers in %s mode, before in %s mode: in doubt (I11)"
            self.warn(frame.ss, frame.es, text % (node, words[header], words[before]), "mode", "M")


def speeds_of(payload):
    return struct.unpack("<%df" % (len(payload) // 4), bytes(payload))


def positions_of(payload):
    """All counts precede all rotations."""
    numbers = [i16(payload[at:at + 2]) for at in range(0, len(payload), 2)]
    return numbers[:len(numbers) // 2], numbers[len(numbers) // 2:]
