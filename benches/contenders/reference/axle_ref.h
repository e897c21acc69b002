/* The reference for axlewire: the CRC and the receivers as firmware usually has them. */
#ifndef AXLE_REF_H
#define AXLE_REF_H

#include <stddef.h>
#include <stdint.h>

/* CRC-16/MODBUS with two tables of 256 bytes. */
uint16_t axle_ref_crc_table(const uint8_t *bytes, size_t len);

/* The same, bit by bit. */
uint16_t axle_ref_crc_bitwise(const uint8_t *bytes, size_t len);

/* The result of a receiver: the number of frames, and a sum over their contents: the id of every
 * frame, and the first four bytes after its header as a little-endian number, if present. */
struct axle_ref_tally {
    uint64_t frames;
    uint64_t sum;
};

/* Each feeds a whole buffer to a fresh receiver, byte by byte. */
struct axle_ref_tally axle_ref_ikeya_table(const uint8_t *bytes, size_t len);
struct axle_ref_tally axle_ref_ikeya_bitwise(const uint8_t *bytes, size_t len);
struct axle_ref_tally axle_ref_ucp_table(const uint8_t *bytes, size_t len);
struct axle_ref_tally axle_ref_ucp_bitwise(const uint8_t *bytes, size_t len);

#endif
