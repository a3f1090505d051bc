/* SPDX-License-Identifier: Apache-2.0 */
/* A board's serial link (cores/board/README.md) by the UART of a Zynq (Cadence; UG585, appendix B.33). The baud rate is
 * what the boot code has set. */
#ifndef FIRM_UART_H
#define FIRM_UART_H

#include "firm_frame.h"
#include "firm_port.h"

typedef struct {
    uintptr_t base;
    firm_decoder_t decoder;
    uint32_t moved_at; /* when bytes came last, ms */
    int is_dropping;   /* what comes, until the line is silent */
    uint32_t errors;
} firm_uart_t;

/* Open the line with a cut; `buffer` holds a frame from the board. */
void firm_uart_open(firm_uart_t *uart, uintptr_t base, uint8_t *buffer, size_t room, unsigned publishers);

/* Send a frame; waits while the line takes no more. */
void firm_uart_send(firm_uart_t *uart, const uint8_t *frame, size_t size);

/* Take what has come: FIRM_FRAME (in decoder.buffer, decoder.filled bytes), or FIRM_MORE if nothing more is there. Bytes
 * that are no frame are counted and dropped until the line is silent, and a cut is made. While firm_uart_is_silent is 0,
 * nothing should be sent that would be answered. */
firm_status_t firm_uart_receive(firm_uart_t *uart);
int firm_uart_is_silent(const firm_uart_t *uart);

#endif
