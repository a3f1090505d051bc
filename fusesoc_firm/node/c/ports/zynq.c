/* SPDX-License-Identifier: Apache-2.0 */
/* Registers and memory of a Zynq, with or without an operating system. With FIRM_XILINX_BSP, AMD's standalone BSP
 * maintains the caches. Otherwise the board's code must disable them for memory that it shares with a DMA engine. */
#include "firm_port.h"

#ifdef FIRM_XILINX_BSP
#include "xil_cache.h"
#endif

uint32_t firm_read(uintptr_t address) { return *(volatile uint32_t *)address; }

void firm_write(uintptr_t address, uint32_t value) { *(volatile uint32_t *)address = value; }

/* Complete all earlier writes before later accesses. */
static void barrier(void) {
#if defined(__aarch64__) || defined(__arm__)
    __asm__ volatile("dsb sy" ::: "memory");
#else
    __sync_synchronize();
#endif
}

void firm_cache_flush(const volatile void *memory, size_t size) {
#ifdef FIRM_XILINX_BSP
    Xil_DCacheFlushRange((INTPTR)memory, size);
#else
    (void)memory;
    (void)size;
#endif
    barrier();
}

void firm_cache_invalidate(const volatile void *memory, size_t size) {
#ifdef FIRM_XILINX_BSP
    Xil_DCacheInvalidateRange((INTPTR)memory, size);
#else
    (void)memory;
    (void)size;
#endif
    barrier();
}

uint64_t firm_bus_address(const volatile void *memory) { return (uint64_t)(uintptr_t)memory; }
