/* What node.c uses of ST's HAL, with its names and arguments; and two functions of a board.
 *
 * In a project of yours, the header that STM32CubeMX makes takes its place, with a pin labelled
 * DRIVER_ENABLE, a USART1 whose receiving DMA is circular, and its calls to start the clock and the
 * peripherals behind HAL_Init; HAL_Micros is yours to write. hal.c is for QEMU, which has no DMA: it
 * fills the buffer in the interrupt of each byte, and raises the callback as DMA and an idle line
 * do. */
#ifndef HAL_H
#define HAL_H

#include <stdint.h>

typedef enum { HAL_OK, HAL_ERROR, HAL_BUSY, HAL_TIMEOUT } HAL_StatusTypeDef;
typedef enum { GPIO_PIN_RESET, GPIO_PIN_SET } GPIO_PinState;
typedef struct {
    uint8_t *pRxBuffPtr;
    uint16_t RxXferSize, RxXferCount;
} UART_HandleTypeDef;

extern UART_HandleTypeDef huart1;

HAL_StatusTypeDef HAL_Init(void);
HAL_StatusTypeDef HAL_UARTEx_ReceiveToIdle_DMA(UART_HandleTypeDef *uart, uint8_t *to, uint16_t size);
HAL_StatusTypeDef HAL_UART_Transmit(UART_HandleTypeDef *uart, const uint8_t *from, uint16_t size,
                                    uint32_t timeout_ms);
void HAL_UARTEx_RxEventCallback(UART_HandleTypeDef *uart, uint16_t size);
/* After noise, a framing error or an overrun, which end the reception by DMA. */
void HAL_UART_ErrorCallback(UART_HandleTypeDef *uart);

typedef struct {
    volatile uint32_t MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR;
} GPIO_TypeDef;
#define DRIVER_ENABLE_GPIO_Port ((GPIO_TypeDef *)0x40020000) /* GPIOA */
#define DRIVER_ENABLE_Pin (1u << 8)
void HAL_GPIO_WritePin(GPIO_TypeDef *port, uint16_t pin, GPIO_PinState state);

/* A timer of 32 bits that counts microseconds, such as TIM2. */
uint32_t HAL_Micros(void);
/* Whether this is QEMU, whose port is slower than a UART. */
int HAL_IsEmulated(void);

int main(void);
void reset(void);

#endif
