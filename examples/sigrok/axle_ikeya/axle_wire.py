"""What the decoders of both protocols share: the search for frames on each wire, the rows of
annotations, and response times. The rules of resync are those of `axlewire::stream`, and
`check.py` compares them with `axle decode --json`.

It lies in the folder of one decoder, and the other loads it from there: libsigrokdecode takes each
folder beside them for a decoder, and each folder that one decoder imports from another for loaded.
"""

from collections import namedtuple

import sigrokdecode as srd

# A byte and the samples from the edge of its start bit to the end of its stop bit.
Byte = namedtuple("Byte", "value ss es")

# Why bytes are skipped, in words (ruling B4).
MEANINGS = {
    "header": "no frame starts here",
    "length": "invalid length",
    "id": "invalid node id",
    "crc": "damaged, or not a frame",
    "idle": "truncated at the end",
}

# The two wires of the UART decoder, by the names of its channels.
WIRES = ("rx", "tx")


def crc16(values):
    """CRC-16/MODBUS (ruling B1)."""
    crc = 0xFFFF
    for value in values:
        crc ^= value
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def crc_fits(values):
    """Whether the last two bytes are the CRC of those before, low byte first."""
    return crc16(values[:-2]) == values[-2] | values[-1] << 8


def i16(values):
    return int.from_bytes(bytes(values), "little", signed=True)


class Frame:
    """A whole frame with a good CRC."""

    def __init__(self, held):
        self.bytes = held
        self.values = [byte.value for byte in held]
        self.ss, self.es = held[0].ss, held[-1].es


class Gap:
    """Bytes that belong to no frame, with the reason of the first, and the count of each reason."""

    def __init__(self):
        self.ss = self.es = self.reason = None
        self.account = {}

    def add(self, skipped, reason):
        if self.reason is None:
            self.ss, self.reason = skipped[0].ss, reason
        self.es = skipped[-1].es
        self.account[reason] = self.account.get(reason, 0) + len(skipped)

    def texts(self):
        length = sum(self.account.values())
        head = "%d %s skipped: %s" % (length, "byte" if length == 1 else "bytes", self.reason)
        text = "%s, %s" % (head, MEANINGS[self.reason])
        if len(self.account) > 1:
            parts = ["%s %d" % (reason, self.account[reason])
                     for reason in MEANINGS if reason in self.account]
            text += " (%s)" % ", ".join(parts)
        return [text, head, "%d %s" % (length, self.reason), self.reason[0]]


class Search:
    """Finds the frames on one wire.

    A candidate that fails costs exactly one byte, and the search goes on inside it (ruling B2).
    `judge` says what the values at the front of a list are: ("frame", length), ("partial", length
    at which more can be said) or ("reject", reason, number of bytes).
    """

    def __init__(self, judge):
        self.judge = judge
        self.held = []
        self.need = 1
        self.gap = Gap()
        self.end = None

    def push(self, byte):
        """Takes a byte; yields what is decided by it."""
        self.held.append(byte)
        self.end = byte.es
        if len(self.held) >= self.need:
            yield from self.look()

    def look(self):
        while self.held:
            verdict = self.judge([byte.value for byte in self.held])
            if verdict[0] == "partial":
                self.need = verdict[1]
                return
            if verdict[0] == "frame":
                yield from self.end_gap()
                frame, self.held = self.held[:verdict[1]], self.held[verdict[1]:]
                yield "frame", Frame(frame)
            else:
                yield self.skip(verdict[1], verdict[2])
        self.need = 1

    def skip(self, reason, count):
        skipped, rest = self.held[:count], self.held[count:]
        values = [byte.value for byte in self.held]
        self.held = rest
        self.gap.add(skipped, reason)
        return "skipped", skipped, reason, values

    def end_gap(self):
        if self.gap.reason is not None:
            yield "gap", self.gap
            self.gap = Gap()

    def idle(self):
        """The line has been quiet for long: nothing completes a candidate from before (B3)."""
        while self.held:
            yield self.skip("idle", 1)
            yield from self.look()
        yield from self.end_gap()

    def is_open(self):
        return bool(self.held) or self.gap.reason is not None


class Request:
    """A frame that is to be answered."""

    def __init__(self, key, frame):
        self.key, self.es = key, frame.es


class WireDecoder(srd.Decoder):
    """Base of the decoders, stacked on `uart`."""

    api_version = 3
    license = "mit"
    inputs = ["uart"]
    outputs = []
    tags = ["Embedded/industrial"]

    SILENCE = {
        "id": "silence_ms",
        "desc": "Silence that ends a candidate, ms (0: none)",
        "default": 20,
    }

    def __init__(self):
        self.reset()

    def reset(self):
        self.samplerate = None
        self.searches = {}
        self.data = {}
        self.classes = {name: number for number, (name, _) in enumerate(self.annotations)}
        self.forget()

    def start(self):
        self.out_ann = self.register(srd.OUTPUT_ANN)

    def metadata(self, key, value):
        if key == srd.SRD_CONF_SAMPLERATE:
            self.samplerate = value

    def note(self, name, ss, es, texts):
        self.put(ss, es, self.out_ann, [self.classes[name], texts])

    def warn(self, ss, es, *texts):
        self.note("warning", ss, es, list(texts))

    def micros(self, samples):
        return samples * 1e6 / self.samplerate

    def time(self, samples):
        """A time for people: nobody reads microseconds of a second."""
        micros = self.micros(samples)
        if abs(micros) < 1e4:
            return "%.1f µs" % micros
        return "%.2f ms" % (micros / 1e3)

    def decode(self, ss, es, data):
        """Takes a packet of the UART decoder."""
        kind, wire, value = data
        if kind == "DATA":
            self.data[wire] = value[0]
        elif kind == "FRAME" and self.data.get(wire) is not None:
            # A frame without data had no start bit.
            if not value[1]:
                self.warn(ss, es, "framing or parity error: is the bit rate right?", "framing", "F")
            self.byte(wire, Byte(self.data[wire] & 0xFF, ss, es))
            self.data[wire] = None
        elif kind == "IDLE":
            self.quiet(wire, es)

    def byte(self, wire, byte):
        search = self.searches.get(wire)
        if search is None:
            search = self.searches[wire] = Search(self.judge)
        self.show(wire, search.push(byte))

    def quiet(self, wire, until):
        """Ends what is open on a wire if it has been silent for long."""
        search = self.searches.get(wire)
        limit = self.options["silence_ms"]
        if search is None or limit <= 0 or self.micros(until - search.end) < limit * 1e3:
            return
        if search.is_open():
            self.show(wire, search.idle())
        self.silent(search.end)

    def silent(self, since):
        """A wire has long been silent, since this sample."""

    def end(self):
        """Nothing follows. Called by versions of libsigrokdecode that know the end of a capture."""
        for wire, search in sorted(self.searches.items()):
            self.show(wire, search.idle())
        self.give_up(None)

    def show(self, wire, events):
        for event in events:
            if event[0] == "frame":
                self.frame(wire, event[1])
            elif event[0] == "gap":
                self.note("gap", event[1].ss, event[1].es, event[1].texts())
            else:
                _, skipped, reason, values = event
                for byte in skipped:
                    text = "%02X" % byte.value
                    self.note("skipped-byte", byte.ss, byte.es, ["%s %s" % (text, reason), text])
                self.refused(wire, skipped, reason, values)

    def show_bytes(self, frame, parts):
        """Shows each byte with the name of its part: pairs of a name and a number of bytes."""
        at = 0
        for name, count in parts:
            for byte in frame.bytes[at:at + count]:
                text = "%02X" % byte.value
                self.note("byte", byte.ss, byte.es, ["%s %s" % (text, name), text])
            at += count

    def value(self, frame, at, count, *texts):
        """Shows the value in some bytes of a frame."""
        held = frame.bytes[at:at + count]
        self.note("value", held[0].ss, held[-1].es, list(texts))
