/* SPDX-License-Identifier: Apache-2.0 */
/* FreeRTOS' critical sections nest and belong to the kernel, so a lock has nothing of its own. */
#ifndef FIRM_PORT_TYPES_H
#define FIRM_PORT_TYPES_H

typedef struct {
    char unused;
} firm_lock_t;

#endif
