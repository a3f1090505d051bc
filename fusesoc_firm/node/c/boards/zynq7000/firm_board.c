/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_board.h"

#include <stddef.h>

#include "firm_port.h"

#ifdef FIRM_FREERTOS
#include "FreeRTOS.h"
#include "task.h"
#endif

/* The interrupt controller (ARM's GIC, appendix B.24 of UG585) and the processor's own timer. */
#define GIC_CONTROL 0xF8F00100u
#define GIC_PRIORITY_MASK 0xF8F00104u
#define GIC_ACKNOWLEDGE 0xF8F0010Cu
#define GIC_END 0xF8F00110u
#define GIC_DISTRIBUTOR 0xF8F01000u
#define GIC_ENABLE 0xF8F01100u
#define GIC_PRIORITY 0xF8F01400u
#define GIC_TARGET 0xF8F01800u
#define TIMER_LOAD 0xF8F00600u
#define TIMER_CONTROL 0xF8F00608u
#define TIMER_STATUS 0xF8F0060Cu

#define TIMER_INTERRUPT 29u
#define SPURIOUS 1023u
/* Counts down, repeats and interrupts. */
#define TIMER_ON 7u
#define LOWEST_ENABLED 0xFFu
/* Below the highest priority from which FreeRTOS may be called, and the lowest there is. */
#define DEVICE_PRIORITY (24u << 3)
#define TICK_PRIORITY (30u << 3)

#define CONSOLE_CONTROL (FIRM_BOARD_CONSOLE + 0x00u)
#define CONSOLE_STATUS (FIRM_BOARD_CONSOLE + 0x2Cu)
#define CONSOLE_FIFO (FIRM_BOARD_CONSOLE + 0x30u)
#define CONSOLE_ON 0x14u
#define CONSOLE_FULL 0x10u

/* Sections of 1 MB in the first-level table of the ARMv7-A architecture, with all access. */
#define SECTIONS 4096u
#define SECTION 0x00000C02u
#define NOT_CACHED 0x00001000u
#define DEVICE 0x00000014u
#define RAM_SECTIONS 1024u

typedef struct {
    void (*handler)(void *context);
    void *context;
} connection_t;

static connection_t connections[FIRM_BOARD_INTERRUPTS];
static uint32_t table[SECTIONS] __attribute__((aligned(4 * SECTIONS)));

void firm_board_map_memory(void) {
    uint32_t control;
    for (uint32_t place = 0; place < SECTIONS; ++place) {
        table[place] = (place << 20) | SECTION | (place < RAM_SECTIONS ? NOT_CACHED : DEVICE);
    }
    __asm__ volatile("mcr p15, 0, %0, c2, c0, 0" ::"r"(table));   /* the table */
    __asm__ volatile("mcr p15, 0, %0, c3, c0, 0" ::"r"(1u));      /* domain 0 is checked */
    __asm__ volatile("mcr p15, 0, %0, c8, c7, 0" ::"r"(0u));      /* forget older translations */
    __asm__ volatile("dsb\n isb\n mrc p15, 0, %0, c1, c0, 0" : "=r"(control));
    __asm__ volatile("mcr p15, 0, %0, c1, c0, 0\n isb" ::"r"(control | 1u));
}

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
    firm_write(TIMER_STATUS, 1);
    ++firm_ticks;
}

static void finish(uint32_t acknowledged) { firm_write(GIC_END, acknowledged); }

#endif

void firm_board_start_tick(void) {
    firm_write(TIMER_LOAD, FIRM_BOARD_CLOCK_HZ / 2000u - 1u);
    firm_write(TIMER_CONTROL, TIMER_ON);
    enable(TIMER_INTERRUPT, TICK_PRIORITY);
}

void firm_board_start(void) {
    firm_write(CONSOLE_CONTROL, CONSOLE_ON);
    firm_write(GIC_DISTRIBUTOR, 1);
    firm_write(GIC_PRIORITY_MASK, LOWEST_ENABLED);
    firm_write(GIC_CONTROL, 1);
#ifndef FIRM_FREERTOS
    firm_board_start_tick();
    __asm__ volatile("cpsie i" ::: "memory");
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
    if (interrupt == TIMER_INTERRUPT) {
        tick();
    } else if (interrupt < FIRM_BOARD_INTERRUPTS && connections[interrupt].handler != NULL) {
        connections[interrupt].handler(connections[interrupt].context);
    }
    finish(acknowledged);
}

void firm_board_answer_interrupt(void) { answer(firm_read(GIC_ACKNOWLEDGE)); }

#ifdef FIRM_FREERTOS
/* Handlers may compute with floating-point numbers: the port's default saves these registers first. */
void vApplicationFPUSafeIRQHandler(uint32_t acknowledged);
void vApplicationFPUSafeIRQHandler(uint32_t acknowledged) { answer(acknowledged); }
#endif

void firm_board_wait(void) { __asm__ volatile("dsb\n wfi" ::: "memory"); }

void firm_board_say(const char *text) {
    for (; *text != '\0'; ++text) {
        while ((firm_read(CONSOLE_STATUS) & CONSOLE_FULL) != 0) {
        }
        firm_write(CONSOLE_FIFO, (uint8_t)*text);
    }
}
