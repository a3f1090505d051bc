/* SPDX-License-Identifier: Apache-2.0 */
/* Without an operating system: payloads are put and sent in one loop, and no interrupt does either. */
#ifndef FIRM_PORT_TYPES_H
#define FIRM_PORT_TYPES_H

typedef struct {
    int is_locked;
} firm_lock_t;

#endif
