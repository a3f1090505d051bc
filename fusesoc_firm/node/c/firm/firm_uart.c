/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_uart.h"

#define CONTROL 0x00u
#define STATUS 0x2Cu
#define FIFO 0x30u

#define CONTROL_RX_ENABLE 0x04u
#define CONTROL_TX_ENABLE 0x10u
#define CONTROL_START_BREAK 0x80u
#define CONTROL_STOP_BREAK 0x100u
#define STATUS_RX_EMPTY 0x02u
#define STATUS_TX_EMPTY 0x08u
#define STATUS_TX_FULL 0x10u

/* Longer than a byte at 9600 baud. */
#define BREAK_MS 3u

static int has(const firm_uart_t *uart, uint32_t bit) { return (firm_read(uart->base + STATUS) & bit) != 0; }

/* Send a break after the bytes that are being sent. */
static void send_break(const firm_uart_t *uart) {
    const uint32_t control = CONTROL_RX_ENABLE | CONTROL_TX_ENABLE;
    uint32_t begun;
    while (!has(uart, STATUS_TX_EMPTY)) {
        firm_pause();
    }
    firm_write(uart->base + CONTROL, control | CONTROL_START_BREAK);
    begun = firm_milliseconds();
    while (firm_milliseconds() - begun < BREAK_MS) {
        firm_pause();
    }
    firm_write(uart->base + CONTROL, control | CONTROL_STOP_BREAK);
}

void firm_uart_open(firm_uart_t *uart, uintptr_t base, uint8_t *buffer, size_t room, unsigned publishers) {
    uart->base = base;
    firm_link_decoder_init(&uart->decoder, buffer, room, publishers);
    firm_write(base + CONTROL, CONTROL_RX_ENABLE | CONTROL_TX_ENABLE);
    send_break(uart);
}

static void put(void *context, uint8_t byte) {
    const firm_uart_t *uart = context;
    while (has(uart, STATUS_TX_FULL)) {
        firm_pause();
    }
    firm_write(uart->base + FIFO, byte);
}

void firm_uart_send(firm_uart_t *uart, const uint8_t *frame, size_t size) { firm_link_encode(frame, size, put, uart); }

firm_link_status_t firm_uart_receive(firm_uart_t *uart) {
    firm_link_status_t status = FIRM_LINK_MORE;
    while (status == FIRM_LINK_MORE && !has(uart, STATUS_RX_EMPTY)) {
        status = firm_link_decoder_push(&uart->decoder, (uint8_t)(firm_read(uart->base + FIFO) & 0xFFu));
    }
    return status;
}
