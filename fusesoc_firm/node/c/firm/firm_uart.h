/* SPDX-License-Identifier: Apache-2.0 */
/* A board's serial link (cores/board/README.md) through the UART of a Zynq (Cadence; UG585, appendix B.33). The boot
 * code sets the baud rate. */
#ifndef FIRM_UART_H
#define FIRM_UART_H

#include "firm_link.h"
#include "firm_port.h"

typedef struct {
    uintptr_t base;
    firm_link_decoder_t decoder; /* it counts frames */
} firm_uart_t;

/* Open the line with a break; `buffer` holds a frame from the board. */
void firm_uart_open(firm_uart_t *uart, uintptr_t base, uint8_t *buffer, size_t room, unsigned publishers);

/* Send a frame; wait while the line is busy. */
void firm_uart_send(firm_uart_t *uart, const uint8_t *frame, size_t size);

/* Read received bytes. Returns FIRM_LINK_FRAME (with decoder.filled bytes in decoder.buffer), FIRM_LINK_BROKEN or
 * FIRM_LINK_REFUSED for a frame that is dropped, or FIRM_LINK_MORE if no bytes are left. */
firm_link_status_t firm_uart_receive(firm_uart_t *uart);

#endif
