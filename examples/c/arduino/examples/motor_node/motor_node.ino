// A motor node of an RS485 bus on Serial1, with a pin that enables the driver of the transceiver.
#include <axlewire.h>

const uint8_t NODE = 1; // 1 to 8
const uint8_t DRIVER_ENABLE = 2;
const uint32_t BAUD = 500000;
const uint32_t STEP_US = 1000;

static axle_ikeya_slave slave;
static axle_clock32 since_start;
static axle_line_rules rules;
static uint64_t empty_at; // when the port was last seen empty
static uint64_t step_at;

static uint64_t now_us() { return axle_clock32_at(&since_start, micros()); }

// Hands in all that has come. After a long step of this loop it may be old: then it counts as no
// command, and is not answered.
static void receive() {
    for (;;) {
        const uint64_t looked_at = now_us();
        uint8_t bytes[64];
        size_t length = 0;
        while (length < sizeof bytes && Serial1.available()) bytes[length++] = Serial1.read();
        if (length == 0) {
            empty_at = looked_at;
            axle_ikeya_slave_handle_timeout(&slave, empty_at);
            return;
        }
        const uint64_t now = now_us();
        if (now - empty_at > rules.held_up_after_us)
            axle_ikeya_slave_handle_old_input(&slave, bytes, length, empty_at, now);
        else
            axle_ikeya_slave_handle_input(&slave, bytes, length, now);
    }
}

// Sends the answer, if one is due. The transceiver drives the line only meanwhile: for as long as
// the bytes take, since `flush` of some cores does not wait.
static void answer() {
    const uint8_t *frame;
    size_t length;
    while (axle_ikeya_slave_poll_transmit(&slave, now_us(), &frame, &length) == AXLE_OK) {
        digitalWrite(DRIVER_ENABLE, HIGH);
        const uint64_t sent_at = now_us() + axle_wire_time_us(length + 1, BAUD);
        const bool is_whole = Serial1.write(frame, length) == length;
        Serial1.flush();
        while (now_us() < sent_at) {}
        digitalWrite(DRIVER_ENABLE, LOW);
        if (!is_whole) axle_ikeya_slave_handle_transmit(&slave, AXLE_TRANSMIT_CUT_OFF, now_us());
    }
}

// A motor that comes to its speed within some 50 ms. Yours is a PWM and an encoder.
static void turn(uint64_t now) {
    static float rps;
    axle_ikeya_motion command = {};
    // Without a command, or with one that is too old, it stands still.
    if (axle_ikeya_slave_get_command(&slave, now, &command) != AXLE_OK) command.velocity_rps[0] = 0;
    rps += (command.velocity_rps[0] - rps) / 16;
    axle_ikeya_slave_set_velocity(&slave, fabs(rps) < 1e-3 ? 0 : rps);
}

void setup() {
    axle_ikeya_slave_config config;
    pinMode(DRIVER_ENABLE, OUTPUT);
    Serial1.begin(BAUD);
    axle_ikeya_slave_config_direct(&config);
    config.watchdog_us = 500000;
    config.two_wire = 1; // it hears the other nodes, too
    axle_ikeya_slave_init(&slave, sizeof slave, NODE, AXLE_IKEYA_MODE_VELOCITY, &config, now_us());
    axle_ikeya_slave_get_line_rules(&slave, &rules);
    empty_at = step_at = now_us();
}

void loop() {
    receive();
    answer();
    if (now_us() < step_at) return;
    turn(now_us());
    step_at = now_us() + STEP_US;
}
