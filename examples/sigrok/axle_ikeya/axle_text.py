"""Numbers as `axle decode` prints them."""

import math
import struct
from fractions import Fraction

COUNTS_PER_TURN = 8192


def fixed(is_negative, magnitude, decimals, width=0):
    """`magnitude` / 10^`decimals`, aligned right. A number that rounds to 0 has a sign."""
    text = "%d" % (magnitude // 10**decimals)
    if decimals:
        text += ".%0*d" % (decimals, magnitude % 10**decimals)
    return ("-" * is_negative + text).rjust(width)


def rounded(scaled, unit):
    """`scaled` / `unit`, rounded half to even."""
    floor, rest = divmod(scaled, unit)
    return floor + (2 * rest > unit or (2 * rest == unit and floor % 2 == 1))


def position_text(counts, rotations):
    """Positions in turns, then the two numbers of each on the wire (ruling I5)."""
    totals = [rotation * COUNTS_PER_TURN + count for count, rotation in zip(counts, rotations)]
    turns = [fixed(total < 0, rounded(abs(total) * 10_000, COUNTS_PER_TURN), 4) for total in totals]
    spaced = [" ".join(map(str, numbers)) for numbers in (turns, rotations, counts)]
    return "%s turns (rotation %s, count %s)" % tuple(spaced)


def shortest(value):
    """The shortest decimal number that reads back as this `f32`."""
    if math.isnan(value):
        return "NaN"
    sign = "-" if math.copysign(1, value) < 0 else ""
    value = abs(value)
    if math.isinf(value):
        return sign + "inf"
    if value == 0:
        return sign + "0.0"
    digits, exponent = shortest_digits(value)
    count = len(digits)
    point = count + exponent
    if -3 <= point <= 0:
        return sign + "0." + "0" * -point + digits
    if 1 <= point <= 16:
        if exponent >= 0:
            return sign + digits + "0" * exponent + ".0"
        return sign + digits[:point] + "." + digits[point:]
    fraction = "." + digits[1:] if count > 1 else ""
    return "%s%s%se%d" % (sign, digits[0], fraction, point - 1)


def shortest_digits(value):
    """Of the numbers that round to `value`, the nearest of those with the fewest digits."""
    bits = struct.unpack("<I", struct.pack("<f", value))[0]
    exponent, fraction = bits >> 23, bits & 0x7FFFFF
    significand = fraction | 0x800000 if exponent else fraction
    # In quarters of the last bit: below a power of two, floats are twice as dense.
    quarter = Fraction(2) ** (max(exponent, 1) - 150 - 2)
    exact = 4 * significand * quarter
    low = exact - quarter * (1 if fraction == 0 and exponent > 1 else 2)
    high = exact + 2 * quarter
    is_even = significand % 2 == 0
    power = math.floor(math.log10(value)) + 2
    while True:
        unit = Fraction(10) ** power
        floor = exact // unit
        fits = [number for number in (floor, floor + 1) if number > 0 and
                (low <= number * unit <= high if is_even else low < number * unit < high)]
        if fits:
            # From the middle up.
            number = str(min(fits, key=lambda number: (abs(number * unit - exact), -number)))
            digits = number.rstrip("0")
            return digits, power + len(number) - len(digits)
        power -= 1
