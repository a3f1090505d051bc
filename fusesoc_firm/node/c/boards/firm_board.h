/* SPDX-License-Identifier: Apache-2.0 */
/* The parts of a Zynq for a program without an operating system, or with FreeRTOS: memory, interrupts, a tick of one
 * millisecond and a console. The processor's folder has the addresses (firm_processor.h), start.S, which starts the
 * program, and the linker script. */
#ifndef FIRM_BOARD_H
#define FIRM_BOARD_H

#include <stdint.h>

#include "firm_processor.h"

/* Enable the interrupts and, without an operating system, the tick, which increments firm_ticks. */
void firm_board_start(void);

/* Start the tick, as FreeRTOS's scheduler does. */
void firm_board_start_tick(void);

/* Let an interrupt (32 to FIRM_BOARD_INTERRUPTS - 1) call a function. */
void firm_board_connect(unsigned interrupt, void (*handler)(void *context), void *context);

/* Answer the pending interrupt. start.S calls it, or FreeRTOS's port. */
void firm_board_answer_interrupt(void);

/* Wait for the next interrupt, for at most a tick. */
void firm_board_wait(void);

/* Write a text to the console; wait while it is busy. */
void firm_board_say(const char *text);

#endif
