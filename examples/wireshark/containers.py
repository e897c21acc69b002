"""Random pcapng files of every kind of block and option, with a UCP ping in each packet."""
import struct

from story import make

LINK_TYPES = (147, 148, 150, 1, 0)
# As they are coded in the option; 0x80 is for powers of two.
UNITS = (None, 0, 3, 6, 7, 9, 0x80, 0x8A, 0x94)
LENGTH = len(make.ucp(1, b""))


def padded(data):
    return data + bytes(-len(data) % 4)


class Section:
    """A section of a file, in one byte order."""

    def __init__(self, random):
        self.random, self.order = random, random.choice("<>")
        self.interfaces, self.blocks = [], []

    def pack(self, form, *values):
        return struct.pack(self.order + form, *values)

    def block(self, kind, body):
        length = self.pack("I", len(body) + 12)
        self.blocks.append(self.pack("I", kind) + length + body + length)

    def options(self, *needed):
        """These options in any order, among others, with or without an end."""
        some = [(1, b"a comment"), (2988, b"\0\0\0\0custom"), (0x7001, bytes(5))]
        every = [*needed, *self.random.sample(some, self.random.randrange(3))]
        self.random.shuffle(every)
        text = b"".join(self.pack("HH", code, len(value)) + padded(value) for code, value in every)
        return text + self.random.choice((b"", bytes(4))) if text else text

    def interface(self):
        unit, offset = self.random.choice(UNITS), self.random.choice((0, 0, 3600, -7200))
        snap = self.random.choice((0, LENGTH, 65535))
        needed = [(9, bytes([unit]))] if unit is not None else []
        needed += [(14, self.pack("q", offset))] if offset else []
        needed += [(2, b"tty%d" % len(self.interfaces))] if self.random.random() < 0.5 else []
        link_type = self.random.choice(LINK_TYPES)
        self.interfaces.append((6 if unit is None else unit, offset, snap))
        self.block(1, self.pack("HHI", link_type, 0, snap) + self.options(*needed))

    def packet(self, frame):
        number = self.random.randrange(len(self.interfaces))
        unit, offset, snap = self.interfaces[number]
        micros = self.random.randrange(1_600_000_000_000_000, 1_900_000_000_000_000)
        per_second = 2 ** (unit & 0x7F) if unit & 0x80 else 10 ** unit
        time = (micros - offset * 1_000_000) * per_second // 1_000_000
        whole = LENGTH + self.random.choice((0, 0, 5))
        high, low = time >> 32, time & 0xFFFFFFFF
        flags = self.random.choice((None, 0, 1, 2, 0b101, 0x40000002))
        needed = [] if flags is None else [(2, self.pack("I", flags))]
        options = self.options(*needed)
        if self.interfaces[0][2] == LENGTH and self.random.random() < 0.2:
            self.block(3, self.pack("I", whole) + padded(frame))
        elif self.random.random() < 0.2:
            self.block(2, self.pack("HHIIII", number, 0, high, low, LENGTH, whole)
                       + padded(frame) + options)
        else:
            self.block(6, self.pack("IIIII", number, high, low, LENGTH, whole)
                       + padded(frame) + options)

    def other(self):
        """A block that is no packet."""
        self.block(*self.random.choice((
            (4, bytes(4)),
            (5, self.pack("III", 0, 0, 0) + self.options()),
            (0xBAD, self.pack("I", 32473) + bytes(8)),
            (0x40000BAD, self.pack("I", 32473) + bytes(4)),
            (0x7FFFFFF1, self.random.randbytes(4 * self.random.randrange(5))),
        )))

    def bytes(self):
        blocks = b"".join(self.blocks)
        length = self.random.choice((-1, len(blocks)))
        options, self.blocks = self.options(), []
        self.block(0x0A0D0D0A, self.pack("IHHq", 0x1A2B3C4D, 1, 0, length) + options)
        return self.blocks[0] + blocks


def capture(random):
    """A file, the number of its packets, and of the interfaces in front of each section."""
    file, count, before = b"", 0, [0]
    for _ in range(random.randrange(1, 4)):
        section = Section(random)
        section.interface()
        for _ in range(random.randrange(30)):
            kind = random.choices((section.packet, section.interface, section.other), (8, 1, 2))[0]
            if kind == section.packet:
                section.packet(make.ucp(1, b"", count % 256))
                count += 1
            else:
                kind()
        file += section.bytes()
        before.append(before[-1] + len(section.interfaces))
    return file, count, before
