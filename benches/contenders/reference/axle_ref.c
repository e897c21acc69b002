/* The receivers are state machines fed one byte at a time, as from a UART interrupt. A frame that
 * fails is dropped as a whole and the search restarts after it. Such code usually does this, and
 * therefore loses good frames after a bad header. */
#include "axle_ref.h"

#include <stdbool.h>

#include "crc_tables.h"

uint16_t axle_ref_crc_table(const uint8_t *bytes, size_t len)
{
    uint8_t low = 0xFF;
    uint8_t high = 0xFF;

    while (len--) {
        uint8_t index = low ^ *bytes++;
        low = high ^ crc_low[index];
        high = crc_high[index];
    }
    return (uint16_t)(high << 8 | low);
}

uint16_t axle_ref_crc_bitwise(const uint8_t *bytes, size_t len)
{
    uint16_t crc = 0xFFFF;

    while (len--) {
        crc ^= *bytes++;
        for (int bit = 0; bit < 8; bit++) {
            if (crc & 1)
                crc = crc >> 1 ^ 0xA001;
            else
                crc >>= 1;
        }
    }
    return crc;
}

/* `bitwise` is a constant wherever this is inlined. */
static inline bool crc_is_right(const uint8_t *frame, size_t len, bool bitwise)
{
    uint16_t crc = bitwise ? axle_ref_crc_bitwise(frame, len - 2) : axle_ref_crc_table(frame, len - 2);

    return frame[len - 2] == (crc & 0xFF) && frame[len - 1] == crc >> 8;
}

static inline uint32_t number_at(const uint8_t *bytes)
{
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

/* --- Ikeya MD: header, id, four bytes unless it is a READ, CRC --- */

struct ikeya_receiver {
    uint8_t frame[8];
    uint8_t have;
    uint8_t length;
};

static inline void ikeya_byte(struct ikeya_receiver *r, uint8_t byte, bool bitwise,
                              struct axle_ref_tally *tally)
{
    if (r->have == 0) {
        switch (byte) {
        case 0xAA:
            r->length = 4;
            break;
        case 0xBB:
        case 0x55:
        case 0x56:
            r->length = 8;
            break;
        default:
            return;
        }
    }
    r->frame[r->have++] = byte;
    if (r->have < r->length)
        return;
    r->have = 0;
    if (!crc_is_right(r->frame, r->length, bitwise))
        return;
    if (r->frame[1] < 1 || r->frame[1] > 8)
        return;
    tally->frames++;
    tally->sum += r->frame[1];
    if (r->length == 8)
        tally->sum += number_at(&r->frame[2]);
}

static inline struct axle_ref_tally ikeya(const uint8_t *bytes, size_t len, bool bitwise)
{
    struct ikeya_receiver receiver = {0};
    struct axle_ref_tally tally = {0};

    while (len--)
        ikeya_byte(&receiver, *bytes++, bitwise, &tally);
    return tally;
}

struct axle_ref_tally axle_ref_ikeya_table(const uint8_t *bytes, size_t len)
{
    return ikeya(bytes, len, false);
}

struct axle_ref_tally axle_ref_ikeya_bitwise(const uint8_t *bytes, size_t len)
{
    return ikeya(bytes, len, true);
}

/* --- UCP: FD FF, length of what follows, id, index, body, CRC --- */

enum {
    UCP_MIN_LEN = 4,
    UCP_MAX_LEN = 60,
    UCP_OUTSIDE_LEN = 4,
};

enum ucp_state { UCP_FIRST, UCP_SECOND, UCP_LEN_LOW, UCP_LEN_HIGH, UCP_REST };

struct ucp_receiver {
    enum ucp_state state;
    uint8_t frame[UCP_MAX_LEN + UCP_OUTSIDE_LEN];
    uint8_t have;
    uint8_t length;
};

static inline void ucp_byte(struct ucp_receiver *r, uint8_t byte, bool bitwise,
                            struct axle_ref_tally *tally)
{
    switch (r->state) {
    case UCP_FIRST:
        if (byte == 0xFD) {
            r->frame[0] = byte;
            r->state = UCP_SECOND;
        }
        return;
    case UCP_SECOND:
        r->frame[1] = byte;
        r->state = byte == 0xFF ? UCP_LEN_LOW : UCP_FIRST;
        return;
    case UCP_LEN_LOW:
        r->frame[2] = byte;
        r->state = byte >= UCP_MIN_LEN && byte <= UCP_MAX_LEN ? UCP_LEN_HIGH : UCP_FIRST;
        return;
    case UCP_LEN_HIGH:
        r->frame[3] = byte;
        r->have = 4;
        r->length = r->frame[2] + UCP_OUTSIDE_LEN;
        r->state = byte == 0 ? UCP_REST : UCP_FIRST;
        return;
    case UCP_REST:
        break;
    }
    r->frame[r->have++] = byte;
    if (r->have < r->length)
        return;
    r->state = UCP_FIRST;
    if (!crc_is_right(r->frame, r->length, bitwise))
        return;
    tally->frames++;
    tally->sum += r->frame[4];
    if (r->length >= 12)
        tally->sum += number_at(&r->frame[6]);
}

static inline struct axle_ref_tally ucp(const uint8_t *bytes, size_t len, bool bitwise)
{
    struct ucp_receiver receiver = {0};
    struct axle_ref_tally tally = {0};

    while (len--)
        ucp_byte(&receiver, *bytes++, bitwise, &tally);
    return tally;
}

struct axle_ref_tally axle_ref_ucp_table(const uint8_t *bytes, size_t len)
{
    return ucp(bytes, len, false);
}

struct axle_ref_tally axle_ref_ucp_bitwise(const uint8_t *bytes, size_t len)
{
    return ucp(bytes, len, true);
}
