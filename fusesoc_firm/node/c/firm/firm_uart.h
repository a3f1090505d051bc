/* SPDX-License-Identifier: Apache-2.0 */
/* A board's serial link (cores/board/README.md) through the UART of a Zynq (Cadence; UG585, appendix B.33). The boot
 * code sets the baud rate. */
#ifndef FIRM_UART_H
#define FIRM_UART_H

#include "firm_frame.h"
#include "firm_port.h"

typedef struct {
    uintptr_t base;
    firm_decoder_t decoder;
    uint32_t moved_at; /* time of the last received bytes, ms */
    int is_dropping;   /* drop received bytes until the line is silent */
    uint32_t errors;
} firm_uart_t;

/* Open the line with a break; `buffer` holds a frame from the board. */
void firm_uart_open(firm_uart_t *uart, uintptr_t base, uint8_t *buffer, size_t room, unsigned publishers);

/* Send a frame; wait while the line is busy. */
void firm_uart_send(firm_uart_t *uart, const uint8_t *frame, size_t size);

/* Read received bytes. Returns FIRM_FRAME (with decoder.filled bytes in decoder.buffer), or FIRM_MORE if no bytes are
 * left. Bytes that do not form a frame are counted and dropped until the line is silent; then a break is sent. While
 * firm_uart_is_silent is 0, do not send a frame that causes a response. */
firm_status_t firm_uart_receive(firm_uart_t *uart);
int firm_uart_is_silent(const firm_uart_t *uart);

#endif
