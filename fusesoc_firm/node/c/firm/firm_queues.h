/* SPDX-License-Identifier: Apache-2.0 */
/* Frames to the hardware: a queue for each subscriber; the least recently used queue is served next (the dissertation's
 * section 6.3.3; docs/reference/host-queues.md), like the default of fusesoc_firm/node/engine/queues.py; here the memory is
 * static.
 *
 * A payload is copied once, outside the lock, into a slot that belongs to its frame until the frame is sent. */
#ifndef FIRM_QUEUES_H
#define FIRM_QUEUES_H

#include <stdbool.h>

#include "firm_config.h"
#include "firm_frame.h"
#include "firm_port.h"

/* Slots for all waiting frames, for each frame that is being written, and for the frame that is being sent. */
#define FIRM_SLOTS (FIRM_SUBSCRIBERS * FIRM_QUEUE_DEPTH + FIRM_WRITERS + 1)

typedef struct {
    uint8_t frames[FIRM_SLOTS][FIRM_HEADER_BYTES + FIRM_LONGEST_PAYLOAD];
    size_t sizes[FIRM_SLOTS];
    uint16_t free[FIRM_SLOTS]; /* a stack */
    unsigned free_count;
    uint16_t waiting[FIRM_SUBSCRIBERS][FIRM_QUEUE_DEPTH]; /* rings */
    unsigned first[FIRM_SUBSCRIBERS];
    unsigned count[FIRM_SUBSCRIBERS];
    uint64_t served_at[FIRM_SUBSCRIBERS]; /* 0: never */
    uint64_t now;
    uint32_t dropped[FIRM_SUBSCRIBERS];
    firm_lock_t lock;
} firm_queues_t;

typedef char firm_slots_have_16_bits[FIRM_SLOTS <= 65535 ? 1 : -1];

/* A frame to send; firm_queues_release releases its slot. */
typedef struct {
    unsigned subscriber;
    const uint8_t *frame;
    size_t size;
    unsigned slot;
} firm_next_t;

void firm_queues_init(firm_queues_t *queues);

/* Add a payload; a full queue drops its oldest. Returns false for an unknown subscriber or an illegal size, and if more
 * than FIRM_WRITERS tasks write. Do not call it in an interrupt. */
bool firm_queues_put(firm_queues_t *queues, unsigned subscriber, const uint8_t *payload, size_t size);

/* Get the next frame; returns false if no frame waits. Only one task may call this function. */
bool firm_queues_get(firm_queues_t *queues, firm_next_t *next);
void firm_queues_release(firm_queues_t *queues, const firm_next_t *next);

#endif
