/* SPDX-License-Identifier: Apache-2.0 */
/* The node's interface to a platform. The folder `ports` has two platforms; another one is a file with these functions
 * and a header firm_port_types.h that defines firm_lock_t. */
#ifndef FIRM_PORT_H
#define FIRM_PORT_H

#include <stddef.h>
#include <stdint.h>

#include "firm_port_types.h"

/* Access to a register of a device. */
uint32_t firm_read(uintptr_t address);
void firm_write(uintptr_t address, uint32_t value);

/* For memory that a device reads next or has written: write the caches' contents back, or discard them. Afterwards the
 * device, or the processor, is certain to see the data. */
void firm_cache_flush(const volatile void *memory, size_t size);
void firm_cache_invalidate(const volatile void *memory, size_t size);

/* Return the address of memory as a device sees it. */
uint64_t firm_bus_address(const volatile void *memory);

/* Delimit short sections that no other task or interrupt may enter. */
void firm_lock(firm_lock_t *lock);
void firm_unlock(firm_lock_t *lock);

/* A clock that wraps around, and a wait of about a millisecond in which other tasks may run. */
uint32_t firm_milliseconds(void);
void firm_pause(void);

#endif
