/* Start, interrupts and a stand-in for ST's HAL on an STM32F405 in QEMU. */
#include "hal.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define RCC_CR REGISTER(0x40023800)
#define RCC_AHB1ENR REGISTER(0x40023830)
#define RCC_APB1ENR REGISTER(0x40023840)
#define RCC_APB2ENR REGISTER(0x40023844)
#define TIM2_CR1 REGISTER(0x40000000)
#define TIM2_EGR REGISTER(0x40000014)
#define TIM2_CNT REGISTER(0x40000024)
#define TIM2_PSC REGISTER(0x40000028)
#define USART1_SR REGISTER(0x40011000)
#define USART1_DR REGISTER(0x40011004)
#define USART1_CR1 REGISTER(0x4001100C)
#define NVIC_ISER1 REGISTER(0xE000E104)
#define CPACR REGISTER(0xE000ED88)

#define USART_ERRORS 0xEu /* framing, noise, overrun */
#define USART_RXNE (1u << 5)
#define USART_TC (1u << 6)
#define USART_TXE (1u << 7)
#define USART1_IRQ 37

UART_HandleTypeDef huart1;

extern uint32_t data_from[], data_begin[], data_end[], bss_begin[], bss_end[];
extern void stack_top(void); /* only its address counts */

int HAL_IsEmulated(void) { return (RCC_CR & 2) == 0; /* no internal oscillator */ }

HAL_StatusTypeDef HAL_Init(void) {
    RCC_AHB1ENR |= 1, RCC_APB1ENR |= 1, RCC_APB2ENR |= 1u << 4;
    TIM2_PSC = (HAL_IsEmulated() ? 1000 : 84) - 1; /* to microseconds */
    TIM2_EGR = 1, TIM2_CR1 = 1;
    USART1_CR1 = 1u << 13 | USART_RXNE | 1u << 3 | 1u << 2;
    NVIC_ISER1 = 1u << (USART1_IRQ - 32);
    return HAL_OK;
}

uint32_t HAL_Micros(void) { return TIM2_CNT; }

void HAL_GPIO_WritePin(GPIO_TypeDef *port, uint16_t pin, GPIO_PinState state) {
    port->BSRR = state == GPIO_PIN_SET ? pin : (uint32_t)pin << 16;
}

HAL_StatusTypeDef HAL_UARTEx_ReceiveToIdle_DMA(UART_HandleTypeDef *uart, uint8_t *to, uint16_t size) {
    uart->RxXferCount = 0, uart->RxXferSize = size, uart->pRxBuffPtr = to;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_UART_Transmit(UART_HandleTypeDef *uart, const uint8_t *from, uint16_t size,
                                    uint32_t timeout_ms) {
    const uint32_t begin = HAL_Micros();
    (void)uart;
    for (; size > 0; --size) {
        while (!(USART1_SR & USART_TXE))
            if (HAL_Micros() - begin > timeout_ms * 1000) return HAL_TIMEOUT;
        USART1_DR = *from++;
    }
    while (!(USART1_SR & USART_TC))
        if (HAL_Micros() - begin > timeout_ms * 1000) return HAL_TIMEOUT;
    return HAL_OK;
}

static void usart1_interrupt(void) {
    UART_HandleTypeDef *uart = &huart1;
    const uint32_t status = USART1_SR;
    if (!(status & (USART_RXNE | USART_ERRORS))) return;
    const uint8_t byte = (uint8_t)USART1_DR;
    if (status & USART_ERRORS) {
        uart->pRxBuffPtr = 0;
        HAL_UART_ErrorCallback(uart);
        return;
    }
    if (!uart->pRxBuffPtr) return;
    uart->pRxBuffPtr[uart->RxXferCount++] = byte;
    HAL_UARTEx_RxEventCallback(uart, uart->RxXferCount);
    if (uart->RxXferCount == uart->RxXferSize) uart->RxXferCount = 0;
}

void reset(void) {
    const uint32_t *from = data_from;
    for (uint32_t *to = data_begin; (uintptr_t)to < (uintptr_t)data_end;) *to++ = *from++;
    for (uint32_t *to = bss_begin; (uintptr_t)to < (uintptr_t)bss_end;) *to++ = 0;
    CPACR |= 0xFu << 20; /* the library uses the FPU */
    main();
    for (;;) {}
}

static void fault(void) {
    for (;;) {}
}

#define SYSTEM_VECTORS 16
__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    stack_top, reset, fault, fault, fault, fault, fault,
    [SYSTEM_VECTORS + USART1_IRQ] = usart1_interrupt,
};
