/* SPDX-License-Identifier: Apache-2.0 */
/* A time limit for waiting for a device. If the clock does not run, because the loop or the scheduler that counts the
 * ticks has not started, the polls of the device's registers are counted instead. */
#ifndef FIRM_LIMIT_H
#define FIRM_LIMIT_H

#include <stdint.h>

typedef struct {
    uint32_t begun, milliseconds, polls;
} firm_limit_t;

firm_limit_t firm_limit_of(uint32_t milliseconds);

/* Return whether the time is over. Call it once after each poll: an access to a register. */
int firm_limit_is_over(firm_limit_t *limit);

#endif
