/* SPDX-License-Identifier: Apache-2.0 */
/* What a program without an operating system, or FreeRTOS, needs of a Zynq-7000 (UG585): memory, interrupts, a tick of
 * one millisecond and a console. start.S starts the program, and zynq7000.ld places it. */
#ifndef FIRM_BOARD_H
#define FIRM_BOARD_H

#include <stdint.h>

/* The UARTs of the processing system: the console, and the link to the hardware (or to another board). */
#define FIRM_BOARD_CONSOLE 0xE0000000u
#define FIRM_BOARD_UART 0xE0001000u
#define FIRM_BOARD_UART_INTERRUPT 82u

/* The processor's clock in Hz, half of which counts the ticks. The boot code sets it. */
#ifndef FIRM_BOARD_CLOCK_HZ
#define FIRM_BOARD_CLOCK_HZ 666666666u
#endif

#define FIRM_BOARD_INTERRUPTS 96u

/* Map all memory: RAM is not cached, so no transfer of a DMA engine needs the caches' maintenance. start.S calls it. */
void firm_board_map_memory(void);

/* Enable the interrupts and, without an operating system, the tick, which increments firm_ticks. */
void firm_board_start(void);

/* Start the tick, as FreeRTOS's scheduler does. */
void firm_board_start_tick(void);

/* Let an interrupt (32 to 95) call a function. */
void firm_board_connect(unsigned interrupt, void (*handler)(void *context), void *context);

/* Answer the pending interrupt. start.S calls it, or FreeRTOS's port. */
void firm_board_answer_interrupt(void);

/* Wait for the next interrupt, for at most a tick. */
void firm_board_wait(void);

/* Write a text to the console; wait while it is busy. */
void firm_board_say(const char *text);

#endif
