/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_processor.h"

#include <stdint.h>

#define TICKS_PER_SECOND 1000u
#define TIMER_ON 1u

static uint64_t period(void) {
    uint64_t frequency;
    __asm__ volatile("mrs %0, cntfrq_el0" : "=r"(frequency));
    return frequency / TICKS_PER_SECOND;
}

void firm_processor_start_tick(void) {
    __asm__ volatile("msr cntp_tval_el0, %0" ::"r"(period()));
    __asm__ volatile("msr cntp_ctl_el0, %0\n isb" ::"r"((uint64_t)TIMER_ON));
}

/* The next tick is a period after this one, even if this one is handled late. */
void firm_processor_clear_tick(void) {
    uint64_t tick;
    __asm__ volatile("mrs %0, cntp_cval_el0" : "=r"(tick));
    __asm__ volatile("msr cntp_cval_el0, %0\n isb" ::"r"(tick + period()));
}

void firm_processor_enable_interrupts(void) { __asm__ volatile("msr daifclr, #2" ::: "memory"); }
