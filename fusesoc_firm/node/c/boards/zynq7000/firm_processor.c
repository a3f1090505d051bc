/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_processor.h"

#include "firm_port.h"

/* The processor's own timer. */
#define TIMER_LOAD 0xF8F00600u
#define TIMER_CONTROL 0xF8F00608u
#define TIMER_STATUS 0xF8F0060Cu
/* Counts down, repeats and interrupts. */
#define TIMER_ON 7u

/* Sections of 1 MB in the first-level table of the ARMv7-A architecture, with all access. */
#define SECTIONS 4096u
#define SECTION 0x00000C02u
#define NOT_CACHED 0x00001000u
#define DEVICE 0x00000014u
#define RAM_SECTIONS 1024u

static uint32_t table[SECTIONS] __attribute__((aligned(4 * SECTIONS)));

void firm_processor_map_memory(void) {
    uint32_t control;
    for (uint32_t place = 0; place < SECTIONS; ++place) {
        table[place] = (place << 20) | SECTION | (place < RAM_SECTIONS ? NOT_CACHED : DEVICE);
    }
    __asm__ volatile("mcr p15, 0, %0, c2, c0, 0" ::"r"(table));   /* the table */
    __asm__ volatile("mcr p15, 0, %0, c3, c0, 0" ::"r"(1u));      /* domain 0 is checked */
    __asm__ volatile("mcr p15, 0, %0, c8, c7, 0" ::"r"(0u));      /* invalidate the TLB */
    __asm__ volatile("dsb\n isb\n mrc p15, 0, %0, c1, c0, 0" : "=r"(control));
    __asm__ volatile("mcr p15, 0, %0, c1, c0, 0\n isb" ::"r"(control | 1u));
}

void firm_processor_start_tick(void) {
    firm_write(TIMER_LOAD, FIRM_BOARD_CLOCK_HZ / 2000u - 1u);
    firm_write(TIMER_CONTROL, TIMER_ON);
}

void firm_processor_clear_tick(void) { firm_write(TIMER_STATUS, 1); }

void firm_processor_enable_interrupts(void) { __asm__ volatile("cpsie i" ::: "memory"); }
