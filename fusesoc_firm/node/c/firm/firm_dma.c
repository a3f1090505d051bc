/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_dma.h"

#include <string.h>

#include "firm_limit.h"

#define MM2S 0x00u
#define S2MM 0x30u
#define CONTROL 0x00u
#define STATUS 0x04u
#define FIRST_DESCRIPTOR 0x08u
#define LAST_DESCRIPTOR 0x10u
/* The offset to the register of an address's upper half, which exists only in an engine with longer addresses. */
#define UPPER 0x04u

#define RUN (1u << 0)
#define RESET (1u << 2)
#define INTERRUPT_ON_COMPLETE (1u << 12)
#define INTERRUPT_ON_ERROR (1u << 14)
#define ONE_FRAME_AN_INTERRUPT (1u << 16)
#define HAS_SCATTER_GATHER (1u << 3)
#define HALTED (1u << 0)
#define FAULTS (0x770u | HALTED)
#define INTERRUPTS (7u << 12)

#define LENGTH ((1u << 26) - 1u)
#define END_OF_FRAME (1u << 26)
#define START_OF_FRAME (1u << 27)
#define COMPLETE (1u << 31)

#define PATIENCE_MS 1000u

typedef char firm_descriptors_have_64_bytes[sizeof(firm_descriptor_t) == 64 ? 1 : -1];

static void make_ring(volatile firm_descriptor_t *ring, uint8_t buffers[][FIRM_DMA_BUFFER_BYTES]) {
    unsigned index;
    for (index = 0; index < FIRM_DMA_BUFFERS; ++index) {
        const firm_descriptor_t empty = {0, 0, 0, 0, {0, 0}, 0, 0, {0, 0, 0, 0, 0, 0, 0, 0}};
        const uint64_t next = firm_bus_address(&ring[(index + 1) % FIRM_DMA_BUFFERS]);
        const uint64_t buffer = firm_bus_address(buffers[index]);
        ring[index] = empty;
        ring[index].next = (uint32_t)next;
        ring[index].next_high = (uint32_t)(next >> 32);
        ring[index].buffer = (uint32_t)buffer;
        ring[index].buffer_high = (uint32_t)(buffer >> 32);
    }
    firm_cache_flush(ring, FIRM_DMA_BUFFERS * sizeof *ring);
}

/* Write the address of a descriptor, the upper half last, as PG021 requires. */
static void point_to(uintptr_t address, const volatile firm_descriptor_t *descriptor) {
    const uint64_t place = firm_bus_address(descriptor);
    firm_write(address, (uint32_t)place);
#if FIRM_DMA_ADDRESS_BITS > 32
    firm_write(address + UPPER, (uint32_t)(place >> 32));
#endif
}

static void hand_over(uintptr_t channel, volatile firm_descriptor_t *descriptor, uint32_t control) {
    descriptor->control = control;
    descriptor->status = 0;
    firm_cache_flush(descriptor, sizeof *descriptor);
    point_to(channel + LAST_DESCRIPTOR, descriptor);
}

static uint32_t status_of(volatile firm_descriptor_t *descriptor) {
    firm_cache_invalidate(descriptor, sizeof *descriptor);
    return descriptor->status;
}

/* Return whether bits of a register become 0 within a short time. */
static int is_cleared(uintptr_t address, uint32_t bits) {
    firm_limit_t limit = firm_limit_of(PATIENCE_MS);
    while ((firm_read(address) & bits) != 0) {
        if (firm_limit_is_over(&limit)) {
            return 0;
        }
        firm_pause();
    }
    return 1;
}

static void start(uintptr_t channel, volatile firm_descriptor_t *ring, uint32_t interrupts) {
    point_to(channel + FIRST_DESCRIPTOR, ring);
    firm_write(channel + CONTROL, RUN | ONE_FRAME_AN_INTERRUPT | interrupts);
}

static void give_back(firm_dma_t *dma, unsigned index) {
    /* Flush, so that no stale cache line is written back over the engine's data. */
    firm_cache_flush(dma->memory->from_buffers[index], FIRM_DMA_BUFFER_BYTES);
    hand_over(dma->base + S2MM, &dma->memory->from_system[index], FIRM_DMA_BUFFER_BYTES);
}

/* Return whether the engine can use the memory. */
static int suits(const firm_dma_memory_t *memory) {
    const uint64_t first = firm_bus_address(memory);
    const uint64_t last = first + (sizeof *memory - 1);
    const uint64_t highest = UINT64_MAX >> (64 - FIRM_DMA_ADDRESS_BITS);
    return (uintptr_t)memory % FIRM_DMA_ALIGNMENT == 0 && first % FIRM_DMA_ALIGNMENT == 0 && first <= last &&
           last <= highest;
}

firm_dma_status_t firm_dma_open(firm_dma_t *dma, uintptr_t base, firm_dma_memory_t *memory) {
    unsigned index;
    memset(dma, 0, sizeof *dma);
    dma->base = base;
    dma->memory = memory;
    if (!suits(memory)) {
        return FIRM_DMA_MEMORY;
    }
    /* The reset of one channel resets both. */
    firm_write(base + MM2S + CONTROL, RESET);
    if (!is_cleared(base + MM2S + CONTROL, RESET)) {
        return FIRM_DMA_STUCK;
    }
    if ((firm_read(base + MM2S + STATUS) & HAS_SCATTER_GATHER) == 0) {
        return FIRM_DMA_NO_SG;
    }
    make_ring(memory->to_system, memory->to_buffers);
    make_ring(memory->from_system, memory->from_buffers);
    start(base + MM2S, memory->to_system, INTERRUPT_ON_ERROR);
    start(base + S2MM, memory->from_system, INTERRUPT_ON_COMPLETE | INTERRUPT_ON_ERROR);
    if (!is_cleared(base + MM2S + STATUS, HALTED) || !is_cleared(base + S2MM + STATUS, HALTED)) {
        return FIRM_DMA_STUCK;
    }
    for (index = 0; index < FIRM_DMA_BUFFERS; ++index) {
        give_back(dma, index);
    }
    return FIRM_DMA_OK;
}

uint32_t firm_dma_fault(const firm_dma_t *dma, int to_system) {
    return firm_read(dma->base + (to_system ? MM2S : S2MM) + STATUS) & FAULTS;
}

static firm_dma_status_t wait_for_room(firm_dma_t *dma) {
    while (dma->handed_over == FIRM_DMA_BUFFERS) {
        if (firm_dma_fault(dma, 1) != 0) {
            return FIRM_DMA_ERROR;
        }
        if ((status_of(&dma->memory->to_system[dma->reclaiming]) & COMPLETE) != 0) {
            dma->reclaiming = (dma->reclaiming + 1) % FIRM_DMA_BUFFERS;
            --dma->handed_over;
        } else {
            firm_pause();
        }
    }
    return firm_dma_fault(dma, 1) != 0 ? FIRM_DMA_ERROR : FIRM_DMA_OK;
}

firm_dma_status_t firm_dma_send(firm_dma_t *dma, const uint8_t *frame, size_t size) {
    uint32_t bits = START_OF_FRAME;
    while (size > 0) {
        const size_t count = size < FIRM_DMA_BUFFER_BYTES ? size : FIRM_DMA_BUFFER_BYTES;
        const firm_dma_status_t status = wait_for_room(dma);
        if (status != FIRM_DMA_OK) {
            return status;
        }
        memcpy(dma->memory->to_buffers[dma->sending], frame, count);
        firm_cache_flush(dma->memory->to_buffers[dma->sending], count);
        if (count == size) {
            bits |= END_OF_FRAME;
        }
        hand_over(dma->base + MM2S, &dma->memory->to_system[dma->sending], (uint32_t)count | bits);
        dma->sending = (dma->sending + 1) % FIRM_DMA_BUFFERS;
        ++dma->handed_over;
        bits = 0;
        frame += count;
        size -= count;
    }
    return FIRM_DMA_OK;
}

firm_dma_status_t firm_dma_receive(firm_dma_t *dma, uint8_t *burst, size_t room, size_t *size) {
    uint32_t status = status_of(&dma->memory->from_system[dma->receiving]);
    while ((status & COMPLETE) != 0) {
        const uint8_t *buffer = dma->memory->from_buffers[dma->receiving];
        size_t count = status & LENGTH;
        if (count > FIRM_DMA_BUFFER_BYTES) {
            return FIRM_DMA_ERROR;
        }
        if ((status & START_OF_FRAME) != 0) {
            dma->received = 0;
        }
        firm_cache_invalidate(buffer, count);
        if (dma->received <= room && count <= room - dma->received) {
            memcpy(burst + dma->received, buffer, count);
            dma->received += count;
        } else {
            dma->received = room + 1;
        }
        give_back(dma, dma->receiving);
        dma->receiving = (dma->receiving + 1) % FIRM_DMA_BUFFERS;
        if ((status & END_OF_FRAME) != 0) {
            *size = dma->received;
            return dma->received <= room ? FIRM_DMA_BURST : FIRM_DMA_TOO_LONG;
        }
        status = status_of(&dma->memory->from_system[dma->receiving]);
    }
    /* A sender without further frames would not notice the loss of a frame in transfer. */
    return (firm_dma_fault(dma, 0) | firm_dma_fault(dma, 1)) != 0 ? FIRM_DMA_ERROR : FIRM_DMA_NOTHING;
}

void firm_dma_answer_interrupt(const firm_dma_t *dma) { firm_write(dma->base + S2MM + STATUS, INTERRUPTS); }

void firm_dma_close(firm_dma_t *dma) {
    firm_write(dma->base + MM2S + CONTROL, RESET);
    (void)is_cleared(dma->base + MM2S + CONTROL, RESET);
}
