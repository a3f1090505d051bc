/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_uart.h"

#include "firm_limit.h"

#define CONTROL 0x00u
#define INTERRUPT_ENABLE 0x08u
#define INTERRUPT_DISABLE 0x0Cu
#define INTERRUPT_STATUS 0x14u
#define RX_TIMEOUT 0x1Cu
#define RX_TRIGGER 0x20u
#define MODEM_CONTROL 0x24u
#define STATUS 0x2Cu
#define FIFO 0x30u
#define FLOW_DELAY 0x38u

#define CONTROL_RX_ENABLE 0x04u
#define CONTROL_TX_ENABLE 0x10u
#define CONTROL_RESTART_TIMEOUT 0x40u
#define CONTROL_START_BREAK 0x80u
#define CONTROL_STOP_BREAK 0x100u
#define STATUS_RX_EMPTY 0x02u
#define STATUS_TX_EMPTY 0x08u
#define STATUS_TX_FULL 0x10u
#define NO_STATUS 0x00u
#define INTERRUPT_RX_TRIGGER 0x01u
#define INTERRUPT_OVERRUN 0x20u
#define INTERRUPT_RX_TIMEOUT 0x100u
#define MODEM_AUTOMATIC 0x20u

#define ENABLED (CONTROL_RX_ENABLE | CONTROL_TX_ENABLE)
#define RX_INTERRUPTS (INTERRUPT_RX_TRIGGER | INTERRUPT_RX_TIMEOUT)
#define ALL_INTERRUPTS 0x1FFFu

/* Longer than a byte at 9600 baud. */
#define BREAK_MS 3u
/* The time of the 64 bytes that the UART may still have to send, at 9600 baud. */
#define EMPTY_MS 100u
/* Received bytes at which the interrupt comes, and at which RTS rises. An adapter may send 16 bytes more. */
#define TRIGGER_BYTES 16u
#define FLOW_BYTES 40u
/* In units of four bits: after this time of silence, fewer bytes also interrupt. */
#define SILENT_TIME 10u

static int has(const firm_uart_t *uart, uint32_t bit) { return (firm_read(uart->base + STATUS) & bit) != 0; }

static size_t after(size_t place) { return (place + 1) % FIRM_UART_STORE_BYTES; }

/* Move received bytes to the store. Returns 0 if the store is full. */
static int drain(firm_uart_t *uart) {
    if ((firm_read(uart->base + INTERRUPT_STATUS) & INTERRUPT_OVERRUN) != 0) {
        firm_write(uart->base + INTERRUPT_STATUS, INTERRUPT_OVERRUN);
        ++uart->overruns;
    }
    while (!has(uart, STATUS_RX_EMPTY)) {
        if (after(uart->end) == uart->first) {
            return 0;
        }
        uart->store[uart->end] = (uint8_t)(firm_read(uart->base + FIFO) & 0xFFu);
        uart->end = after(uart->end);
    }
    return 1;
}

/* Wait for a status, but no longer than this time. A pause of the platform may be so long that the UART overflows. */
static void wait_for(firm_uart_t *uart, uint32_t status, uint32_t milliseconds) {
    firm_limit_t limit = firm_limit_of(milliseconds);
    while (!has(uart, status) && !firm_limit_is_over(&limit)) {
        (void)drain(uart);
    }
}

/* Send a break after the bytes that are being sent. */
static void send_break(firm_uart_t *uart) {
    wait_for(uart, STATUS_TX_EMPTY, EMPTY_MS);
    firm_write(uart->base + CONTROL, ENABLED | CONTROL_START_BREAK);
    wait_for(uart, NO_STATUS, BREAK_MS);
    firm_write(uart->base + CONTROL, ENABLED | CONTROL_STOP_BREAK);
}

void firm_uart_open(firm_uart_t *uart, uintptr_t base, uint8_t *buffer, size_t room, unsigned publishers) {
    uart->base = base;
    uart->first = 0;
    uart->end = 0;
    uart->has_interrupt = 0;
    uart->is_held = 0;
    uart->overruns = 0;
    firm_link_decoder_init(&uart->decoder, buffer, room, publishers);
    firm_write(base + INTERRUPT_DISABLE, ALL_INTERRUPTS);
    firm_write(base + INTERRUPT_STATUS, ALL_INTERRUPTS);
    firm_write(base + CONTROL, ENABLED);
    send_break(uart);
}

void firm_uart_use_flow_control(firm_uart_t *uart) {
    firm_write(uart->base + FLOW_DELAY, FLOW_BYTES);
    firm_write(uart->base + MODEM_CONTROL, MODEM_AUTOMATIC);
}

void firm_uart_use_interrupt(firm_uart_t *uart) {
    uart->has_interrupt = 1;
    firm_write(uart->base + RX_TRIGGER, TRIGGER_BYTES);
    firm_write(uart->base + RX_TIMEOUT, SILENT_TIME);
    firm_write(uart->base + CONTROL, ENABLED | CONTROL_RESTART_TIMEOUT);
    firm_write(uart->base + INTERRUPT_ENABLE, RX_INTERRUPTS);
}

void firm_uart_answer_interrupt(firm_uart_t *uart) {
    /* Before the bytes are read, so that a later byte interrupts again. */
    firm_write(uart->base + INTERRUPT_STATUS, RX_INTERRUPTS);
    if (!drain(uart)) {
        firm_write(uart->base + INTERRUPT_DISABLE, RX_INTERRUPTS);
        uart->is_held = 1;
    }
    firm_write(uart->base + CONTROL, ENABLED | CONTROL_RESTART_TIMEOUT);
}

/* The frame that is being sent byte by byte. */
typedef struct {
    firm_uart_t *uart;
    int is_lost;
} sender_t;

static void put(void *context, uint8_t byte) {
    sender_t *sender = context;
    firm_uart_t *uart = sender->uart;
    firm_limit_t limit;
    int is_full;
    if (sender->is_lost) {
        return;
    }
    limit = firm_limit_of(FIRM_UART_PATIENCE_MS);
    /* Without a pause, in which more bytes could arrive than the UART or the store holds. */
    do {
        if (!uart->has_interrupt) {
            (void)drain(uart);
        }
        is_full = has(uart, STATUS_TX_FULL);
    } while (is_full && !firm_limit_is_over(&limit));
    if (is_full) {
        sender->is_lost = 1;
        return;
    }
    firm_write(uart->base + FIFO, byte);
}

int firm_uart_send(firm_uart_t *uart, const uint8_t *frame, size_t size) {
    sender_t sender;
    sender.uart = uart;
    sender.is_lost = 0;
    firm_link_encode(frame, size, put, &sender);
    return !sender.is_lost;
}

firm_link_status_t firm_uart_receive(firm_uart_t *uart) {
    firm_link_status_t status = FIRM_LINK_MORE;
    if (!uart->has_interrupt) {
        (void)drain(uart);
    }
    while (status == FIRM_LINK_MORE && uart->first != uart->end) {
        const uint8_t byte = uart->store[uart->first];
        uart->first = after(uart->first);
        status = firm_link_decoder_push(&uart->decoder, byte);
    }
    if (uart->is_held && uart->first == uart->end) {
        uart->is_held = 0;
        firm_write(uart->base + INTERRUPT_ENABLE, RX_INTERRUPTS);
    }
    return status;
}
