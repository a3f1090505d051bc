/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_queues.h"

#include <string.h>

void firm_queues_init(firm_queues_t *queues) {
    unsigned slot;
    memset(queues->first, 0, sizeof queues->first);
    memset(queues->count, 0, sizeof queues->count);
    memset(queues->served_at, 0, sizeof queues->served_at);
    memset(queues->dropped, 0, sizeof queues->dropped);
    memset(&queues->lock, 0, sizeof queues->lock);
    queues->now = 0;
    queues->free_count = FIRM_SLOTS;
    for (slot = 0; slot < FIRM_SLOTS; ++slot) {
        queues->free[slot] = (uint16_t)slot;
    }
}

/* Remove a subscriber's first frame from its queue and return its slot. */
static uint16_t pop(firm_queues_t *queues, unsigned subscriber) {
    const uint16_t slot = queues->waiting[subscriber][queues->first[subscriber]];
    queues->first[subscriber] = (queues->first[subscriber] + 1) % FIRM_QUEUE_DEPTH;
    --queues->count[subscriber];
    return slot;
}

static void push(firm_queues_t *queues, unsigned subscriber, uint16_t slot) {
    queues->waiting[subscriber][(queues->first[subscriber] + queues->count[subscriber]) % FIRM_QUEUE_DEPTH] = slot;
    ++queues->count[subscriber];
}

static void give_back(firm_queues_t *queues, uint16_t slot) { queues->free[queues->free_count++] = slot; }

bool firm_queues_put(firm_queues_t *queues, unsigned subscriber, const uint8_t *payload, size_t size) {
    uint16_t slot = 0;
    bool has_slot;
    if (subscriber >= FIRM_SUBSCRIBERS || size > FIRM_LONGEST_PAYLOAD) {
        return false;
    }
    firm_lock(&queues->lock);
    has_slot = queues->free_count > 0;
    if (has_slot) {
        slot = queues->free[--queues->free_count];
    }
    firm_unlock(&queues->lock);
    if (!has_slot) {
        return false;
    }
    queues->sizes[slot] =
        firm_frame_encode(queues->frames[slot], sizeof queues->frames[slot], (uint8_t)subscriber, payload, size);
    firm_lock(&queues->lock);
    if (queues->count[subscriber] == FIRM_QUEUE_DEPTH) {
        give_back(queues, pop(queues, subscriber));
        ++queues->dropped[subscriber];
    }
    push(queues, subscriber, slot);
    firm_unlock(&queues->lock);
    return true;
}

/* Find the least recently served subscriber with frames; among equal ones, the lowest index. */
static bool find_next(const firm_queues_t *queues, unsigned *next) {
    bool is_found = false;
    unsigned subscriber;
    for (subscriber = 0; subscriber < FIRM_SUBSCRIBERS; ++subscriber) {
        if (queues->count[subscriber] > 0 &&
            (!is_found || queues->served_at[subscriber] < queues->served_at[*next])) {
            *next = subscriber;
            is_found = true;
        }
    }
    return is_found;
}

bool firm_queues_get(firm_queues_t *queues, firm_next_t *next) {
    bool is_found;
    firm_lock(&queues->lock);
    is_found = find_next(queues, &next->subscriber);
    if (is_found) {
        queues->served_at[next->subscriber] = ++queues->now;
        next->slot = pop(queues, next->subscriber);
        next->frame = queues->frames[next->slot];
        next->size = queues->sizes[next->slot];
    }
    firm_unlock(&queues->lock);
    return is_found;
}

void firm_queues_release(firm_queues_t *queues, const firm_next_t *next) {
    firm_lock(&queues->lock);
    give_back(queues, (uint16_t)next->slot);
    firm_unlock(&queues->lock);
}
