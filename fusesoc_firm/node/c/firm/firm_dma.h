/* SPDX-License-Identifier: Apache-2.0 */
/* AXI DMA between memory and the system's streams, as the block design of a board with a processor has it
 * (docs/how-to/build-for-a-board.md): scatter and gather, 26 bits of length, 32 of address, no realignment. PG021 has registers and
 * descriptors. What is C++ in firm/dma_transport.hpp is C here, with static memory and caches. */
#ifndef FIRM_DMA_H
#define FIRM_DMA_H

#include "firm_config.h"
#include "firm_frame.h"
#include "firm_port.h"

#define FIRM_DMA_ALIGNMENT 64

typedef struct {
    uint32_t next, next_high, buffer, buffer_high, reserved[2], control, status, unused[8];
} firm_descriptor_t;

/* What processor and engine share; it must begin at a multiple of FIRM_DMA_ALIGNMENT, below 4 GiB. */
typedef struct {
    volatile firm_descriptor_t to_system[FIRM_DMA_BUFFERS];
    volatile firm_descriptor_t from_system[FIRM_DMA_BUFFERS];
    uint8_t to_buffers[FIRM_DMA_BUFFERS][FIRM_DMA_BUFFER_BYTES];
    uint8_t from_buffers[FIRM_DMA_BUFFERS][FIRM_DMA_BUFFER_BYTES];
} firm_dma_memory_t;

typedef enum {
    FIRM_DMA_OK,
    FIRM_DMA_NOTHING,   /* no burst is there */
    FIRM_DMA_BURST,     /* one is */
    FIRM_DMA_TOO_LONG,  /* one was, but did not fit where it was to go */
    FIRM_DMA_STUCK,     /* the engine does not answer */
    FIRM_DMA_NO_SG,     /* it has no scatter and gather */
    FIRM_DMA_ERROR      /* it has stopped: firm_dma_fault */
} firm_dma_status_t;

typedef struct {
    uintptr_t base; /* of its registers: 0x40400000 (Zynq-7000), 0xA0000000 (UltraScale+) */
    firm_dma_memory_t *memory;
    unsigned sending, reclaiming, handed_over;
    unsigned receiving;
    size_t received; /* bytes of the burst that has begun */
} firm_dma_t;

/* Reset the engine, and with it the system, and let it run. FIRM_DMA_OK or why not. */
firm_dma_status_t firm_dma_open(firm_dma_t *dma, uintptr_t base, firm_dma_memory_t *memory);

/* Send a frame: FIRM_DMA_OK when it is in the engine's buffers; waits while they are full. One task. */
firm_dma_status_t firm_dma_send(firm_dma_t *dma, const uint8_t *frame, size_t size);

/* Take what has come of a burst to `burst`, which has `room`: FIRM_DMA_BURST when it is whole, of `size` bytes. The next
 * call begins another one. One task, which may be another than the one that sends. */
firm_dma_status_t firm_dma_receive(firm_dma_t *dma, uint8_t *burst, size_t room, size_t *size);

/* Of the channel of `to_system` or the other one, the bits of DMASR that say why it has stopped: 4 DMAIntErr, 5 DMASlvErr,
 * 6 DMADecErr, 8 SGIntErr, 9 SGSlvErr, 10 SGDecErr, 0 halted; 0 if it runs. */
uint32_t firm_dma_fault(const firm_dma_t *dma, int to_system);

/* For the handler of S2MM's interrupt: it is answered. Then firm_dma_receive, here or in a task. */
void firm_dma_answer_interrupt(const firm_dma_t *dma);

/* Stop the engine. */
void firm_dma_close(firm_dma_t *dma);

#endif
