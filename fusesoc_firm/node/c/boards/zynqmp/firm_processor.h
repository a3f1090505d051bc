/* SPDX-License-Identifier: Apache-2.0 */
/* A Zynq UltraScale+ (UG1085), on whose first Cortex-A53 the program runs, at the exception level at which it starts. */
#ifndef FIRM_PROCESSOR_H
#define FIRM_PROCESSOR_H

/* The UARTs of the processing system: the console, and the link to the hardware (or to another board). */
#define FIRM_BOARD_CONSOLE 0xFF000000u
#define FIRM_BOARD_UART 0xFF010000u
#define FIRM_BOARD_UART_INTERRUPT 54u

#define FIRM_BOARD_INTERRUPTS 192u

/* The GIC-400, and the interrupt of the physical timer of exception level 1. */
#define FIRM_PROCESSOR_GIC 0xF9020000u
#define FIRM_PROCESSOR_GIC_DISTRIBUTOR 0xF9010000u
#define FIRM_PROCESSOR_TICK_INTERRUPT 30u

void firm_processor_start_tick(void);
void firm_processor_clear_tick(void);
void firm_processor_enable_interrupts(void);

#endif
