/* SPDX-License-Identifier: Apache-2.0 */
/* A board's serial link (cores/board/README.md) through the UART of a Zynq (Cadence; UG585, appendix B.33). The boot
 * code sets the baud rate.
 *
 * The UART holds 64 received bytes, 640 us at 1 Mbaud. They are moved to a store in memory whenever a function of this
 * file runs, also while it sends. A program that calls them less often lets an interrupt move the bytes. */
#ifndef FIRM_UART_H
#define FIRM_UART_H

#include "firm_config.h"
#include "firm_link.h"
#include "firm_port.h"

typedef struct {
    uintptr_t base;
    firm_link_decoder_t decoder; /* it counts frames */
    uint8_t store[FIRM_UART_STORE_BYTES]; /* a ring of received bytes; full with one byte less */
    volatile size_t first, end;
    int has_interrupt;
    volatile int is_held;        /* the store was full, and the interrupt is disabled */
    volatile uint32_t overruns;  /* times at which the UART lost bytes that were not read in time */
} firm_uart_t;

/* Open the line with a break; `buffer` holds a frame from the board. The clock need not run. */
void firm_uart_open(firm_uart_t *uart, uintptr_t base, uint8_t *buffer, size_t room, unsigned publishers);

/* Use RTS and CTS, if they are wired: the board waits while the store is full, and this side waits for the board. */
void firm_uart_use_flow_control(firm_uart_t *uart);

/* Let the UART's interrupt move received bytes to the store. Its handler must call firm_uart_answer_interrupt. */
void firm_uart_use_interrupt(firm_uart_t *uart);
void firm_uart_answer_interrupt(firm_uart_t *uart);

/* Send a frame; wait while the line is busy. Returns 0 if the line took no byte for FIRM_UART_PATIENCE_MS; then this
 * frame is lost. Receive after each frame: the store has room for the bytes that arrive during one. */
int firm_uart_send(firm_uart_t *uart, const uint8_t *frame, size_t size);

/* Read received bytes. Returns FIRM_LINK_FRAME (with decoder.filled bytes in decoder.buffer), FIRM_LINK_BROKEN or
 * FIRM_LINK_REFUSED for a frame that is dropped, or FIRM_LINK_MORE if no bytes are left. */
firm_link_status_t firm_uart_receive(firm_uart_t *uart);

#endif
