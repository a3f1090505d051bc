/* SPDX-License-Identifier: Apache-2.0 */
/* What the node needs of a platform: the folder `ports` has two, another one is a file with these functions and a header
 * firm_port_types.h, which defines firm_lock_t. */
#ifndef FIRM_PORT_H
#define FIRM_PORT_H

#include <stddef.h>
#include <stdint.h>

#include "firm_port_types.h"

/* A register of a device. */
uint32_t firm_read(uintptr_t address);
void firm_write(uintptr_t address, uint32_t value);

/* Memory that a device reads next, or has written: the caches' contents go there, or are forgotten. Then it is certain
 * that the device, or the processor, sees them. */
void firm_cache_flush(const volatile void *memory, size_t size);
void firm_cache_invalidate(const volatile void *memory, size_t size);

/* A device's address of memory. */
uint32_t firm_bus_address(const volatile void *memory);

/* Short sections that no other task or interrupt enters. */
void firm_lock(firm_lock_t *lock);
void firm_unlock(firm_lock_t *lock);

/* A clock that wraps, and a wait of about a millisecond, in which others may run. */
uint32_t firm_milliseconds(void);
void firm_pause(void);

#endif
