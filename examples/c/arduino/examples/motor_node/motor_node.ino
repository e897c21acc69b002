// A motor node of an RS485 bus on Serial1, with a pin that enables the driver of the transceiver.
#include <axlewire.h>

const uint8_t NODE = 1; // 1 to 8
const uint8_t DRIVER_ENABLE = 2;
const uint32_t STEP_US = 1000;

static axle_ikeya_slave slave;
static axle_clock32 since_start;
static uint64_t step_at;

static uint64_t now_us() { return axle_clock32_at(&since_start, micros()); }

// Hands in all that has come. The library is told when the port was seen to be empty.
static void receive() {
    for (;;) {
        const uint64_t empty_at = now_us();
        uint8_t bytes[64];
        size_t length = 0;
        while (length < sizeof bytes && Serial1.available()) bytes[length++] = Serial1.read();
        if (length == 0) {
            axle_ikeya_slave_handle_timeout(&slave, empty_at);
            return;
        }
        axle_ikeya_slave_handle_input(&slave, bytes, length, now_us());
    }
}

// Sends the answer, if one is due. The transceiver drives the line only meanwhile.
static void answer() {
    const uint8_t *frame;
    size_t length;
    while (axle_ikeya_slave_poll_transmit(&slave, now_us(), &frame, &length) == AXLE_OK) {
        digitalWrite(DRIVER_ENABLE, HIGH);
        const bool is_whole = Serial1.write(frame, length) == length;
        Serial1.flush();
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
    Serial1.begin(500000);
    axle_ikeya_slave_config_direct(&config);
    config.watchdog_us = 500000;
    config.two_wire = 1; // it hears the other nodes, too
    axle_ikeya_slave_init(&slave, sizeof slave, NODE, AXLE_IKEYA_MODE_VELOCITY, &config, now_us());
    step_at = now_us();
}

void loop() {
    receive();
    answer();
    if (now_us() < step_at) return;
    turn(step_at);
    step_at += STEP_US;
}
