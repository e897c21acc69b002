/* What usual receivers of firmware make of a line, beside this library: frames found, and speed.
 * Returns 0 only if the library finds every frame. */
#define _POSIX_C_SOURCE 199309L
#include <axlewire.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define ANSWERS 100000
#define SIZE 8 /* bytes of an answer of a motor board */
static uint8_t line[ANSWERS * SIZE + ANSWERS / 50];
static size_t length;

/* Answers of a bus; a stray byte that looks like a start of a frame goes before each 50th, if so. */
static void fill(int is_noisy) {
    const axle_ikeya_packet packet = {.kind = AXLE_IKEYA_PACKET_VELOCITY, .node = 1, .motors = 1};
    uint8_t answer[SIZE];
    size_t size;
    axle_ikeya_encode(&packet, answer, sizeof answer, &size);
    length = 0;
    for (int at = 0; at < ANSWERS; ++at) {
        if (is_noisy && at % 50 == 49) line[length++] = answer[0];
        memcpy(line + length, answer, SIZE);
        length += SIZE;
    }
}

static uint8_t table_low[256], table_high[256];

static void make_tables(void) {
    for (unsigned byte = 0; byte < 256; ++byte) {
        uint16_t crc = (uint16_t)byte;
        for (int bit = 0; bit < 8; ++bit) crc = (uint16_t)(crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1);
        table_low[byte] = (uint8_t)crc, table_high[byte] = (uint8_t)(crc >> 8);
    }
}

static uint16_t crc_of_tables(const uint8_t *bytes, size_t count) {
    uint8_t low = 0xFF, high = 0xFF;
    while (count--) {
        const uint8_t at = low ^ *bytes++;
        low = high ^ table_low[at], high = table_high[at];
    }
    return (uint16_t)(low | (unsigned)high << 8);
}

static int is_answer(const uint8_t *bytes) {
    return bytes[0] == 0x55 && crc_of_tables(bytes, 6) == (bytes[6] | (unsigned)bytes[7] << 8);
}

/* As with HAL_UART_Receive: always a whole packet. */
static size_t whole_packets(void) {
    size_t frames = 0;
    for (size_t at = 0; at + SIZE <= length; at += SIZE) frames += (size_t)is_answer(line + at);
    return frames;
}

/* A buffer that 64 bytes at a time are appended to, and whose rest is moved to the front. */
static size_t moved_buffer(void) {
    uint8_t buffer[256];
    size_t held = 0, frames = 0;
    for (size_t at = 0; at < length;) {
        const size_t count = length - at < 64 ? length - at : 64;
        memcpy(buffer + held, line + at, count);
        at += count, held += count;
        while (held >= SIZE) {
            const size_t used = is_answer(buffer) ? SIZE : 1;
            frames += used == SIZE;
            memmove(buffer, buffer + used, held -= used);
        }
    }
    return frames;
}

/* A state machine in the interrupt of a byte: waits for a header, then for the rest. */
static size_t byte_by_byte(void) {
    uint8_t frame[SIZE];
    size_t have = 0, frames = 0;
    for (size_t at = 0; at < length; ++at) {
        if (have == 0 && line[at] != 0x55) continue;
        frame[have++] = line[at];
        if (have < SIZE) continue;
        have = 0;
        frames += (size_t)is_answer(frame);
    }
    return frames;
}

static axle_ikeya_decoder decoder;

static size_t axle_pushed(void) {
    axle_stream_event event;
    size_t frames = 0;
    axle_ikeya_decoder_init(&decoder, sizeof decoder, AXLE_IKEYA_TO_MASTER);
    for (size_t at = 0; at < length; ++at) {
        if (axle_ikeya_decoder_push(&decoder, line[at]) != AXLE_OK) continue;
        while (axle_ikeya_decoder_poll(&decoder, &event) == AXLE_OK)
            frames += event.kind == AXLE_STREAM_FRAME;
    }
    return frames;
}

static size_t axle_many(void) {
    axle_stream_event events[64];
    size_t frames = 0, count, rest = length;
    const uint8_t *data = line;
    axle_ikeya_decoder_init(&decoder, sizeof decoder, AXLE_IKEYA_TO_MASTER);
    while (axle_ikeya_decoder_decode_many(&decoder, &data, &rest, events, 64, &count) == AXLE_OK)
        for (size_t at = 0; at < count; ++at) frames += events[at].kind == AXLE_STREAM_FRAME;
    return frames;
}

/* The CRC of each answer; the sum keeps the compiler from leaving it out. */
static size_t crc_of(uint16_t (*crc)(const uint8_t *, size_t)) {
    size_t sum = 0;
    for (size_t at = 0; at + 42 <= length; at += 42) sum += crc(line + at, 42);
    return sum;
}
static size_t two_tables(void) { return crc_of(crc_of_tables); }
static size_t axle_crc(void) { return crc_of(axle_crc16); }

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

static double fastest(size_t (*work)(void), size_t *result) {
    double best = 1e9;
    for (int round = 0; round < 9; ++round) {
        const double begin = seconds();
        *result = work();
        const double took = seconds() - begin;
        if (took < best) best = took;
    }
    return best;
}

int main(void) {
    static const struct {
        const char *name;
        size_t (*work)(void);
    } all[] = {{"whole packets", whole_packets}, {"buffer, memmove", moved_buffer},
               {"byte by byte", byte_by_byte},   {"_push, _poll", axle_pushed},
               {"_decode_many", axle_many}};
    int is_right = 1;
    make_tables();
    double slowest = 0;
    for (size_t at = 0; at < sizeof all / sizeof *all; ++at) {
        size_t clean, noisy;
        fill(1);
        noisy = all[at].work();
        fill(0);
        const double took = fastest(all[at].work, &clean);
        if (at == 2) slowest = took;
        printf("%-16s %6.2f %% of the frames, with stray bytes %6.2f %%", all[at].name,
               100.0 * (double)clean / ANSWERS, 100.0 * (double)noisy / ANSWERS);
        if (slowest > 0) printf(", %5.2f times as fast as byte by byte", slowest / took);
        puts("");
        if (at >= 3) is_right &= clean == ANSWERS && noisy == ANSWERS;
    }
    size_t expected, crc;
    const double tables = fastest(two_tables, &expected), ours = fastest(axle_crc, &crc);
    printf("CRC of 42 bytes: axle_crc16 %.2f times as fast as two tables\n", tables / ours);
    return is_right && expected == crc ? 0 : 1;
}
