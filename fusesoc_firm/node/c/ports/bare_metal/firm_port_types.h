/* SPDX-License-Identifier: Apache-2.0 */
/* Without an operating system, one loop queues and sends payloads, and no interrupt does, so no lock is needed. */
#ifndef FIRM_PORT_TYPES_H
#define FIRM_PORT_TYPES_H

typedef struct {
    int is_locked;
} firm_lock_t;

#endif
