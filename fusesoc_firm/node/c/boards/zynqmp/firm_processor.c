/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_processor.h"

#include <stdint.h>

#define TICKS_PER_SECOND 1000u
#define TIMER_ON 1u

/* The timer counts from the tick's end, so that each tick is late by its answer; no tick is lost. */
static void wait_for_tick(void) {
    uint64_t frequency;
    __asm__ volatile("mrs %0, cntfrq_el0" : "=r"(frequency));
    __asm__ volatile("msr cntp_tval_el0, %0" ::"r"(frequency / TICKS_PER_SECOND));
}

void firm_processor_start_tick(void) {
    wait_for_tick();
    __asm__ volatile("msr cntp_ctl_el0, %0\n isb" ::"r"((uint64_t)TIMER_ON));
}

void firm_processor_clear_tick(void) {
    wait_for_tick();
    __asm__ volatile("isb");
}

void firm_processor_enable_interrupts(void) { __asm__ volatile("msr daifclr, #2" ::: "memory"); }
