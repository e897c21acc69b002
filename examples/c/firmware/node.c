/* A motor node of an RS485 bus on an STM32F405, in the style of ST's HAL.
 *
 * DMA fills a ring, and an idle line or a full half of it raises the callback, which only notes how
 * far it is. All else is done in the main loop: nothing is called from an interrupt. */
#include <axlewire.h>

#include "hal.h"

#define NODE 1 /* 1 to 8 */
#define STEP_US 1000

static axle_ikeya_slave slave;
static axle_clock32 since_start;
static uint8_t ring[256];
static uint16_t taken;
static uint64_t empty_at; /* when all had been taken */
static axle_line_rules rules;
static volatile uint16_t filled; /* DMA writes here next */
static volatile uint8_t has_ended;

static uint64_t now_us(void) { return axle_clock32_at(&since_start, HAL_Micros()); }

void HAL_UARTEx_RxEventCallback(UART_HandleTypeDef *uart, uint16_t size) {
    (void)uart;
    filled = size % sizeof ring;
}

/* The HAL has ended the reception: what the line damaged costs a packet, not the node. */
void HAL_UART_ErrorCallback(UART_HandleTypeDef *uart) {
    (void)uart;
    has_ended = 1;
}

static void begin_to_receive(void) {
    has_ended = 0, taken = 0, filled = 0;
    HAL_UARTEx_ReceiveToIdle_DMA(&huart1, ring, sizeof ring);
}

/* Hands in bytes. After a long step of this loop they may be old: they count as no command, and are
 * not answered. */
static void hand_in(const uint8_t *bytes, size_t length) {
    const uint64_t now = now_us();
    if (now - empty_at > rules.held_up_after_us)
        axle_ikeya_slave_handle_old_input(&slave, bytes, length, empty_at, now);
    else
        axle_ikeya_slave_handle_input(&slave, bytes, length, now);
}

/* Hands in what has come since the last call. */
static void receive(void) {
    const uint64_t looked_at = now_us();
    const uint16_t end = filled;
    if (end < taken) {
        hand_in(ring + taken, sizeof ring - taken);
        taken = 0;
    }
    hand_in(ring + taken, (size_t)(end - taken));
    taken = end, empty_at = looked_at;
    axle_ikeya_slave_handle_timeout(&slave, empty_at);
    if (has_ended) begin_to_receive();
}

/* Sends the answer, if one is due. The transceiver drives the line only meanwhile. */
static void answer(void) {
    const uint8_t *frame;
    size_t length;
    while (axle_ikeya_slave_poll_transmit(&slave, now_us(), &frame, &length) == AXLE_OK) {
        HAL_GPIO_WritePin(DRIVER_ENABLE_GPIO_Port, DRIVER_ENABLE_Pin, GPIO_PIN_SET);
        if (HAL_UART_Transmit(&huart1, frame, (uint16_t)length, 2) != HAL_OK)
            axle_ikeya_slave_handle_transmit(&slave, AXLE_TRANSMIT_CUT_OFF, now_us());
        HAL_GPIO_WritePin(DRIVER_ENABLE_GPIO_Port, DRIVER_ENABLE_Pin, GPIO_PIN_RESET);
    }
}

/* A motor that comes to its speed within some 50 ms. Yours is a PWM and an encoder. */
static void turn(uint64_t now) {
    static float rps;
    axle_ikeya_motion command = {0};
    /* Without a command, or with one that is too old, it stands still. */
    if (axle_ikeya_slave_get_command(&slave, now, &command) != AXLE_OK) command.velocity_rps[0] = 0;
    rps += (command.velocity_rps[0] - rps) / 16;
    axle_ikeya_slave_set_velocity(&slave, rps > -1e-3f && rps < 1e-3f ? 0 : rps);
}

int main(void) {
    axle_ikeya_slave_config config;
    HAL_Init();
    axle_ikeya_slave_config_direct(&config);
    if (HAL_IsEmulated()) axle_ikeya_slave_config_usb_adapter(&config);
    config.watchdog_us = 500000;
    config.two_wire = 1; /* it hears the other nodes, too */
    axle_ikeya_slave_init(&slave, sizeof slave, NODE, AXLE_IKEYA_MODE_VELOCITY, &config, now_us());
    axle_ikeya_slave_get_line_rules(&slave, &rules);
    begin_to_receive();
    empty_at = now_us();
    for (uint64_t step_at = empty_at;;) {
        receive();
        answer();
        if (now_us() < step_at) continue;
        turn(now_us());
        step_at = now_us() + STEP_US;
    }
}
