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

#define SILENCE_MS 50u
#define LONGEST_PAUSE_MS 200u
/* Longer than a byte at 9600 baud. */
#define BREAK_MS 3u

static int has(const firm_uart_t *uart, uint32_t bit) { return (firm_read(uart->base + STATUS) & bit) != 0; }

static uint32_t since(uint32_t time) { return firm_milliseconds() - time; }

/* Send a break after the bytes that are being sent. */
static void cut(firm_uart_t *uart) {
    const uint32_t control = CONTROL_RX_ENABLE | CONTROL_TX_ENABLE;
    uint32_t begun;
    while (!has(uart, STATUS_TX_EMPTY)) {
        firm_pause();
    }
    firm_write(uart->base + CONTROL, control | CONTROL_START_BREAK);
    begun = firm_milliseconds();
    while (since(begun) < BREAK_MS) {
        firm_pause();
    }
    firm_write(uart->base + CONTROL, control | CONTROL_STOP_BREAK);
    uart->is_dropping = 1;
    uart->moved_at = firm_milliseconds();
    firm_decoder_reset(&uart->decoder);
}

void firm_uart_open(firm_uart_t *uart, uintptr_t base, uint8_t *buffer, size_t room, unsigned publishers) {
    uart->base = base;
    uart->errors = 0;
    firm_decoder_init(&uart->decoder, buffer, room, publishers);
    firm_write(base + CONTROL, CONTROL_RX_ENABLE | CONTROL_TX_ENABLE);
    cut(uart);
}

void firm_uart_send(firm_uart_t *uart, const uint8_t *frame, size_t size) {
    size_t place;
    for (place = 0; place < size; ++place) {
        while (has(uart, STATUS_TX_FULL)) {
            firm_pause();
        }
        firm_write(uart->base + FIFO, frame[place]);
    }
}

/* Handle silence on the line. */
static void be_silent(firm_uart_t *uart) {
    if (uart->is_dropping) {
        uart->is_dropping = since(uart->moved_at) < SILENCE_MS;
    } else if (firm_decoder_has_begun(&uart->decoder) && since(uart->moved_at) >= LONGEST_PAUSE_MS) {
        ++uart->errors;
        cut(uart);
    }
}

firm_status_t firm_uart_receive(firm_uart_t *uart) {
    while (!has(uart, STATUS_RX_EMPTY)) {
        const uint8_t byte = (uint8_t)(firm_read(uart->base + FIFO) & 0xFFu);
        size_t taken;
        firm_status_t status;
        uart->moved_at = firm_milliseconds();
        if (uart->is_dropping) {
            continue;
        }
        status = firm_decoder_push(&uart->decoder, &byte, 1, &taken);
        if (status == FIRM_FRAME) {
            return status;
        }
        if (status != FIRM_MORE) {
            ++uart->errors;
            cut(uart);
        }
    }
    be_silent(uart);
    return FIRM_MORE;
}

int firm_uart_is_silent(const firm_uart_t *uart) { return !uart->is_dropping; }
