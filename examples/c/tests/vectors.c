/* Every recorded frame, parsed, encoded again and decoded through C.
 * `check_vectors.sh` makes vectors.inc of the files in tests/vectors. */
#include "axlewire.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct motor_vector {
    uint8_t bytes[16];
    size_t length;
    axle_result result;
    uint8_t header, node, motors;
    bool is_velocity;
    uint32_t bits[3];
    bool is_position;
    int16_t count[3], rotation[3];
};

struct rover_vector {
    uint8_t bytes[64];
    size_t length;
    axle_result result;
    uint8_t id, index;
    int16_t speed, turn;
    uint16_t battery;
    int16_t heading;
    uint32_t state;
    uint8_t calibration;
    int16_t acc_bias[3];
};

#include "vectors.inc"

#define CHECK(condition)                                                                          \
    do {                                                                                          \
        if (!(condition)) {                                                                       \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #condition);               \
            exit(1);                                                                              \
        }                                                                                         \
    } while (0)

static void encodes_motor(const axle_ikeya_packet *packet, const struct motor_vector *vector) {
    uint8_t bytes[AXLE_IKEYA_PACKET_MAX_LENGTH];
    size_t length = 0;
    axle_result result = axle_ikeya_encode(packet, bytes, sizeof bytes, &length);
    bool is_speed = packet->kind == AXLE_IKEYA_PACKET_VELOCITY ||
                    packet->kind == AXLE_IKEYA_PACKET_WRITE_VELOCITY;
    for (int motor = 0; is_speed && motor < 3; motor++) {
        uint32_t bits;
        memcpy(&bits, &packet->velocity_rps[motor], sizeof bits);
        if ((bits & 0x7f800000u) == 0x7f800000u) {
            CHECK(result == AXLE_ERROR_NOT_FINITE);
            return;
        }
    }
    CHECK(result == AXLE_OK && length == vector->length);
    CHECK(memcmp(bytes, vector->bytes, length) == 0);
    CHECK(axle_ikeya_encode(packet, bytes, length - 1, &length) == AXLE_ERROR_BUFFER_TOO_SMALL);
}

static void parse_motor(const struct motor_vector *vector) {
    axle_ikeya_packet packet;
    CHECK(axle_ikeya_parse(vector->bytes, vector->length, &packet) == vector->result);
    if (vector->result != AXLE_OK) {
        return;
    }
    CHECK(packet.node == vector->node);
    CHECK(vector->header == 0xAA || packet.motors == vector->motors);
    for (int motor = 0; motor < 3; motor++) {
        uint32_t bits;
        memcpy(&bits, &packet.velocity_rps[motor], sizeof bits);
        CHECK(!vector->is_velocity || bits == vector->bits[motor]);
        CHECK(!vector->is_position || packet.position[motor].count == vector->count[motor]);
        CHECK(!vector->is_position || packet.position[motor].rotation == vector->rotation[motor]);
    }
    if (vector->header == 0xBB) {
        CHECK(packet.kind == AXLE_IKEYA_PACKET_WRITE);
        packet.kind = AXLE_IKEYA_PACKET_WRITE_POSITION;
        encodes_motor(&packet, vector);
        packet.kind = AXLE_IKEYA_PACKET_WRITE_VELOCITY;
    }
    encodes_motor(&packet, vector);
}

static void parse_rover(const struct rover_vector *vector) {
    axle_ucp_message message;
    uint8_t bytes[AXLE_UCP_FRAME_MAX_LENGTH];
    size_t length = 0;
    CHECK(axle_ucp_parse(vector->bytes, vector->length, &message) == AXLE_OK);
    CHECK(message.id == vector->id && message.index == vector->index);
    CHECK(message.speed_pct == vector->speed && message.turn_pct == vector->turn);
    CHECK(message.telemetry.battery_pct == vector->battery);
    CHECK(message.telemetry.heading_deg == vector->heading);
    CHECK(message.network_state == vector->state && message.calibration == vector->calibration);
    CHECK(memcmp(message.imu_bias.acc, vector->acc_bias, sizeof vector->acc_bias) == 0);
    CHECK(axle_ucp_encode(&message, bytes, sizeof bytes, &length) == vector->result);
    if (vector->result == AXLE_OK) {
        CHECK(length == vector->length && memcmp(bytes, vector->bytes, length) == 0);
        CHECK(axle_ucp_encode(&message, bytes, length - 1, &length) ==
              AXLE_ERROR_BUFFER_TOO_SMALL);
    }
}

static bool is_frame(const axle_stream_event *event, const uint8_t *bytes, size_t length) {
    return event->kind == AXLE_STREAM_FRAME && event->length == length &&
           memcmp(event->bytes, bytes, length) == 0;
}

/* Each way in which bytes can arrive: the whole frame, and nothing else, is told. */
#define DECODES(name, type, decode, push, poll, spare, commit, pending)                           \
    static void name(type *decoder, const uint8_t *bytes, size_t length) {                        \
        axle_stream_event event;                                                                  \
        for (size_t chunk = 1; chunk <= length; chunk++) {                                        \
            bool found = false;                                                                   \
            for (size_t at = 0; at < length; at += chunk) {                                       \
                const uint8_t *data = bytes + at;                                                 \
                size_t left = length - at < chunk ? length - at : chunk;                          \
                while (decode(decoder, &data, &left, &event) == AXLE_OK) {                        \
                    CHECK(!found && is_frame(&event, bytes, length));                             \
                    found = true;                                                                 \
                }                                                                                 \
                CHECK(left == 0);                                                                 \
            }                                                                                     \
            CHECK(found);                                                                         \
        }                                                                                         \
        for (size_t at = 0; at < length; at++) {                                                  \
            CHECK(push(decoder, bytes[at]) >= 0);                                                 \
            CHECK(at + 1 == length || poll(decoder, &event) == AXLE_NONE);                        \
        }                                                                                         \
        CHECK(poll(decoder, &event) == AXLE_OK && is_frame(&event, bytes, length));               \
        CHECK(poll(decoder, &event) == AXLE_NONE);                                                \
        for (size_t at = 0; at < length;) {                                                       \
            uint8_t *to;                                                                          \
            size_t room;                                                                          \
            CHECK(spare(decoder, &to, &room) == AXLE_OK && room > 0);                             \
            size_t count = length - at < room ? length - at : room;                               \
            memcpy(to, bytes + at, count);                                                        \
            CHECK(commit(decoder, count) == AXLE_OK);                                             \
            at += count;                                                                          \
            CHECK(at == length || poll(decoder, &event) == AXLE_NONE);                            \
        }                                                                                         \
        CHECK(poll(decoder, &event) == AXLE_OK && is_frame(&event, bytes, length));               \
        size_t held = 1;                                                                          \
        CHECK(poll(decoder, &event) == AXLE_NONE);                                                \
        CHECK(pending(decoder, &held) == AXLE_OK && held == 0);                                   \
    }

DECODES(decodes_motor, axle_ikeya_decoder, axle_ikeya_decoder_decode, axle_ikeya_decoder_push,
        axle_ikeya_decoder_poll, axle_ikeya_decoder_spare, axle_ikeya_decoder_commit,
        axle_ikeya_decoder_get_pending)
DECODES(decodes_rover, axle_ucp_decoder, axle_ucp_decoder_decode, axle_ucp_decoder_push,
        axle_ucp_decoder_poll, axle_ucp_decoder_spare, axle_ucp_decoder_commit,
        axle_ucp_decoder_get_pending)

int main(void) {
    size_t motor_count = sizeof motors / sizeof motors[0];
    size_t rover_count = sizeof rovers / sizeof rovers[0];
    /* Not initialised, and not in zeroed memory: only `_init` writes to them. */
    axle_ikeya_decoder one, three;
    axle_ucp_decoder rover;
    CHECK(axle_ikeya_decoder_init(&one, sizeof one, AXLE_IKEYA_BOTH_DIRECTIONS) == AXLE_OK);
    CHECK(axle_ikeya_decoder_init(&three, sizeof three, AXLE_IKEYA3_BOTH_DIRECTIONS) == AXLE_OK);
    CHECK(axle_ucp_decoder_init(&rover, sizeof rover) == AXLE_OK);
    for (size_t at = 0; at < motor_count; at++) {
        const struct motor_vector *vector = &motors[at];
        parse_motor(vector);
        if (vector->result == AXLE_OK) {
            decodes_motor(vector->motors == 3 ? &three : &one, vector->bytes, vector->length);
        }
    }
    for (size_t at = 0; at < rover_count; at++) {
        parse_rover(&rovers[at]);
        decodes_rover(&rover, rovers[at].bytes, rovers[at].length);
    }
    printf("%zu packets and %zu messages\n", motor_count, rover_count);
    return motor_count > 0 && rover_count > 0 ? 0 : 1;
}
