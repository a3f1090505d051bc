/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_limit.h"

#include "firm_port.h"

/* No supported processor accesses a device's register in less than 50 ns. */
#define POLLS_A_MILLISECOND 20000u

firm_limit_t firm_limit_of(uint32_t milliseconds) {
    firm_limit_t limit;
    limit.begun = firm_milliseconds();
    limit.milliseconds = milliseconds;
    limit.polls = 0;
    return limit;
}

int firm_limit_is_over(firm_limit_t *limit) {
    ++limit->polls;
    return firm_milliseconds() - limit->begun >= limit->milliseconds ||
           limit->polls / POLLS_A_MILLISECOND >= limit->milliseconds;
}
