#include "Arduino.h"
extern "C" {
#include "hal.h"
}

Port Serial1;
static uint8_t ring[256];
static volatile uint16_t filled;
static uint16_t taken;

void HAL_UARTEx_RxEventCallback(UART_HandleTypeDef *, uint16_t size) { filled = size % sizeof ring; }
void HAL_UART_ErrorCallback(UART_HandleTypeDef *) {}

uint32_t micros() { return HAL_Micros(); }
bool Port::available() { return taken != filled; }
int Port::read() {
    const uint8_t byte = ring[taken];
    taken = (taken + 1) % sizeof ring;
    return byte;
}
size_t Port::write(const uint8_t *bytes, size_t length) {
    return HAL_UART_Transmit(&huart1, bytes, length, 2) == HAL_OK ? length : 0;
}

int main() {
    HAL_Init();
    HAL_UARTEx_ReceiveToIdle_DMA(&huart1, ring, sizeof ring);
    setup();
    for (;;) loop();
}
