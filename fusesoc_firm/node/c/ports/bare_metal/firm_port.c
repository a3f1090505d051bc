/* SPDX-License-Identifier: Apache-2.0 */
/* Without an operating system. The timer is the board's: its interrupt, or its loop, counts firm_ticks up every
 * millisecond. */
#include "firm_port.h"

volatile uint32_t firm_ticks;

void firm_lock(firm_lock_t *lock) { lock->is_locked = 1; }

void firm_unlock(firm_lock_t *lock) { lock->is_locked = 0; }

uint32_t firm_milliseconds(void) { return firm_ticks; }

void firm_pause(void) {}
