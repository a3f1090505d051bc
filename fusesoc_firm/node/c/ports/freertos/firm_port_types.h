/* SPDX-License-Identifier: Apache-2.0 */
/* FreeRTOS's critical sections nest and belong to the kernel, so a lock needs no data. */
#ifndef FIRM_PORT_TYPES_H
#define FIRM_PORT_TYPES_H

typedef struct {
    char unused;
} firm_lock_t;

#endif
