/* SPDX-License-Identifier: Apache-2.0 */
/* AXI DMA between memory and the system's streams, for the block design of a board with a processor
 * (docs/how-to/build-for-a-board.md): scatter-gather, 26-bit lengths, addresses of FIRM_DMA_ADDRESS_BITS, no realignment. PG021
 * describes registers and descriptors. This is firm/dma_transport.hpp in C, with static memory and cache maintenance.
 * */
#ifndef FIRM_DMA_H
#define FIRM_DMA_H

#include "firm_config.h"
#include "firm_frame.h"
#include "firm_port.h"

#define FIRM_DMA_ALIGNMENT 64

typedef struct {
    uint32_t next, next_high, buffer, buffer_high, reserved[2], control, status, unused[8];
} firm_descriptor_t;

/* Memory shared by processor and engine, where the engine reaches it. Variables of this type are aligned; memory from
 * elsewhere must begin at a multiple of FIRM_DMA_ALIGNMENT. */
typedef struct {
    volatile firm_descriptor_t to_system[FIRM_DMA_BUFFERS];
    volatile firm_descriptor_t from_system[FIRM_DMA_BUFFERS];
    uint8_t to_buffers[FIRM_DMA_BUFFERS][FIRM_DMA_BUFFER_BYTES];
    uint8_t from_buffers[FIRM_DMA_BUFFERS][FIRM_DMA_BUFFER_BYTES];
} __attribute__((aligned(FIRM_DMA_ALIGNMENT))) firm_dma_memory_t;

typedef enum {
    FIRM_DMA_OK,
    FIRM_DMA_NOTHING,   /* no complete burst yet */
    FIRM_DMA_BURST,     /* a complete burst */
    FIRM_DMA_TOO_LONG,  /* a burst that did not fit its destination */
    FIRM_DMA_STUCK,     /* the engine does not respond */
    FIRM_DMA_NO_SG,     /* the engine lacks scatter and gather */
    FIRM_DMA_ERROR,     /* the engine has stopped: see firm_dma_fault */
    FIRM_DMA_MEMORY     /* the memory is not aligned, or beyond the engine's addresses */
} firm_dma_status_t;

typedef struct {
    uintptr_t base; /* address of its registers: 0x40400000 (Zynq-7000), 0xA0000000 (UltraScale+) */
    firm_dma_memory_t *memory;
    unsigned sending, reclaiming, handed_over;
    unsigned receiving;
    size_t received; /* bytes of the current burst */
} firm_dma_t;

/* Reset the engine and thereby the system, then start the engine. Returns FIRM_DMA_OK or the reason for failure. */
firm_dma_status_t firm_dma_open(firm_dma_t *dma, uintptr_t base, firm_dma_memory_t *memory);

/* Send a frame; wait while the engine's buffers are full. Returns FIRM_DMA_OK. Only one task may call this function. */
firm_dma_status_t firm_dma_send(firm_dma_t *dma, const uint8_t *frame, size_t size);

/* Append received bytes to `burst`, which has room for `room` bytes. Returns FIRM_DMA_BURST when the burst is complete,
 * with its length in `size`; the next call begins another. One task only, which need not be the sending one. */
firm_dma_status_t firm_dma_receive(firm_dma_t *dma, uint8_t *burst, size_t room, size_t *size);

/* Return the bits of DMASR with the reason for the stop of the channel (`to_system` or the other one): 4 DMAIntErr,
 * 5 DMASlvErr, 6 DMADecErr, 8 SGIntErr, 9 SGSlvErr, 10 SGDecErr, 0 halted. Returns 0 if the channel runs. */
uint32_t firm_dma_fault(const firm_dma_t *dma, int to_system);

/* Acknowledge S2MM's interrupt, in its handler. Then call firm_dma_receive, in the handler or in a task. */
void firm_dma_answer_interrupt(const firm_dma_t *dma);

/* Stop the engine. */
void firm_dma_close(firm_dma_t *dma);

#endif
