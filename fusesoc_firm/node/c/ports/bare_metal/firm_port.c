/* SPDX-License-Identifier: Apache-2.0 */
/* A platform without an operating system. The board provides the timer: an interrupt or a loop increments firm_ticks
 * every millisecond. */
#include "firm_port.h"

volatile uint32_t firm_ticks;

void firm_lock(firm_lock_t *lock) { lock->is_locked = 1; }

void firm_unlock(firm_lock_t *lock) { lock->is_locked = 0; }

uint32_t firm_milliseconds(void) { return firm_ticks; }

void firm_pause(void) {}
