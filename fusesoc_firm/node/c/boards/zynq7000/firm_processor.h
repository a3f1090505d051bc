/* SPDX-License-Identifier: Apache-2.0 */
/* A Zynq-7000 (UG585), on whose first Cortex-A9 the program runs. */
#ifndef FIRM_PROCESSOR_H
#define FIRM_PROCESSOR_H

/* The UARTs of the processing system: the console, and the link to the hardware (or to another board). */
#define FIRM_BOARD_CONSOLE 0xE0000000u
#define FIRM_BOARD_UART 0xE0001000u
#define FIRM_BOARD_UART_INTERRUPT 82u

/* The processor's clock in Hz, half of which counts the ticks. The boot code sets it. */
#ifndef FIRM_BOARD_CLOCK_HZ
#define FIRM_BOARD_CLOCK_HZ 666666666u
#endif

#define FIRM_BOARD_INTERRUPTS 96u

/* Appendix B.24 of UG585. */
#define FIRM_PROCESSOR_GIC 0xF8F00100u
#define FIRM_PROCESSOR_GIC_DISTRIBUTOR 0xF8F01000u
#define FIRM_PROCESSOR_TICK_INTERRUPT 29u

/* Map all memory: RAM is not cached, so DMA transfers need no cache maintenance. start.S calls it. */
void firm_processor_map_memory(void);

void firm_processor_start_tick(void);
void firm_processor_clear_tick(void);
void firm_processor_enable_interrupts(void);

#endif
