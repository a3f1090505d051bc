/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_board.h"

#include <stddef.h>

#include "firm_port.h"

#ifdef FIRM_FREERTOS
#include "FreeRTOS.h"
#include "task.h"
#endif

/* The interrupt controller, ARM's GIC (version 1 or 2). */
#define GIC_CONTROL (FIRM_PROCESSOR_GIC + 0x00u)
#define GIC_PRIORITY_MASK (FIRM_PROCESSOR_GIC + 0x04u)
#define GIC_ACKNOWLEDGE (FIRM_PROCESSOR_GIC + 0x0Cu)
#define GIC_END (FIRM_PROCESSOR_GIC + 0x10u)
#define GIC_DISTRIBUTOR (FIRM_PROCESSOR_GIC_DISTRIBUTOR + 0x000u)
#define GIC_ENABLE (FIRM_PROCESSOR_GIC_DISTRIBUTOR + 0x100u)
#define GIC_PRIORITY (FIRM_PROCESSOR_GIC_DISTRIBUTOR + 0x400u)
#define GIC_TARGET (FIRM_PROCESSOR_GIC_DISTRIBUTOR + 0x800u)

#define SPURIOUS 1023u
#define LOWEST_ENABLED 0xFFu
/* Below the highest priority from which FreeRTOS may be called, and the lowest priority. */
#define DEVICE_PRIORITY (24u << 3)
#define TICK_PRIORITY (30u << 3)

#define CONSOLE_CONTROL (FIRM_BOARD_CONSOLE + 0x00u)
#define CONSOLE_STATUS (FIRM_BOARD_CONSOLE + 0x2Cu)
#define CONSOLE_FIFO (FIRM_BOARD_CONSOLE + 0x30u)
#define CONSOLE_ON 0x14u
#define CONSOLE_FULL 0x10u

typedef struct {
    void (*handler)(void *context);
    void *context;
} connection_t;

static connection_t connections[FIRM_BOARD_INTERRUPTS];

static void write_byte(uintptr_t address, unsigned value) { *(volatile uint8_t *)address = (uint8_t)value; }

static void enable(unsigned interrupt, unsigned priority) {
    write_byte(GIC_PRIORITY + interrupt, priority);
    write_byte(GIC_TARGET + interrupt, 1);
    firm_write(GIC_ENABLE + 4 * (interrupt / 32), 1u << (interrupt % 32));
}

#ifdef FIRM_FREERTOS

static void tick(void) { FreeRTOS_Tick_Handler(); }

/* FreeRTOS's port acknowledges and ends the interrupt. */
static void finish(uint32_t acknowledged) { (void)acknowledged; }

#else

extern volatile uint32_t firm_ticks;

static void tick(void) {
    firm_processor_clear_tick();
    ++firm_ticks;
}

static void finish(uint32_t acknowledged) { firm_write(GIC_END, acknowledged); }

#endif

void firm_board_start_tick(void) {
    firm_processor_start_tick();
    enable(FIRM_PROCESSOR_TICK_INTERRUPT, TICK_PRIORITY);
}

void firm_board_start(void) {
    firm_write(CONSOLE_CONTROL, CONSOLE_ON);
    firm_write(GIC_DISTRIBUTOR, 1);
    firm_write(GIC_PRIORITY_MASK, LOWEST_ENABLED);
    firm_write(GIC_CONTROL, 1);
#ifndef FIRM_FREERTOS
    firm_board_start_tick();
    firm_processor_enable_interrupts();
#endif
}

void firm_board_connect(unsigned interrupt, void (*handler)(void *context), void *context) {
    if (interrupt < FIRM_BOARD_INTERRUPTS) {
        connections[interrupt].context = context;
        connections[interrupt].handler = handler;
        enable(interrupt, DEVICE_PRIORITY);
    }
}

static void answer(uint32_t acknowledged) {
    const uint32_t interrupt = acknowledged & 0x3FFu;
    if (interrupt == SPURIOUS) {
        return;
    }
    if (interrupt == FIRM_PROCESSOR_TICK_INTERRUPT) {
        tick();
    } else if (interrupt < FIRM_BOARD_INTERRUPTS && connections[interrupt].handler != NULL) {
        connections[interrupt].handler(connections[interrupt].context);
    }
    finish(acknowledged);
}

void firm_board_answer_interrupt(void) { answer(firm_read(GIC_ACKNOWLEDGE)); }

#ifdef FIRM_FREERTOS
/* Handlers may use floating-point numbers: the port's default saves these registers first. */
void vApplicationFPUSafeIRQHandler(uint32_t acknowledged);
void vApplicationFPUSafeIRQHandler(uint32_t acknowledged) { answer(acknowledged); }
#endif

void firm_board_wait(void) { __asm__ volatile("dsb sy\n wfi" ::: "memory"); }

void firm_board_say(const char *text) {
    for (; *text != '\0'; ++text) {
        while ((firm_read(CONSOLE_STATUS) & CONSOLE_FULL) != 0) {
        }
        firm_write(CONSOLE_FIFO, (uint8_t)*text);
    }
}
