/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_bursts.h"

#include <string.h>

#define BEAT_BYTES ((size_t)(FIRM_WIDTH / 8))
#define RECORD_BYTES ((size_t)FIRM_HEADER_BYTES + 2u)
#define RECORD_ID 255u
#define RECORD_LENGTH 0xFFFFFFFFu
#define ROOM ((size_t)FIRM_HEADER_BYTES + FIRM_LONGEST_PAYLOAD)

void firm_joiner_init(firm_joiner_t *joiner) { memset(joiner->filled, 0, sizeof joiner->filled); }

/* Check a frame by the `size` bytes received so far, which do not exceed its buffer. */
static firm_status_t judged(const uint8_t *frame, size_t size) {
    uint32_t length;
    if (size < FIRM_HEADER_BYTES) {
        return FIRM_MORE;
    }
    length = firm_frame_length(frame);
    if (length > FIRM_LONGEST_PAYLOAD) {
        return FIRM_TOO_LONG;
    }
    if (size - FIRM_HEADER_BYTES > length) {
        return FIRM_LONGER;
    }
    return size - FIRM_HEADER_BYTES == length ? FIRM_FRAME : FIRM_MORE;
}

/* A record of an aborted frame: the status id, a length that no frame has, the aborted id, and a code. */
static int is_record(const uint8_t *burst, size_t size) {
    return size == RECORD_BYTES && burst[0] == RECORD_ID && firm_frame_length(burst) == RECORD_LENGTH;
}

static firm_status_t aborted(firm_joiner_t *joiner, uint8_t id) {
    if (id >= FIRM_PUBLISHERS) {
        return FIRM_BAD_ID;
    }
    joiner->filled[id] = 0;
    return FIRM_ABORTED;
}

firm_status_t firm_joiner_push(firm_joiner_t *joiner, const uint8_t *burst, size_t size, int tid, const uint8_t **frame,
                               size_t *frame_bytes) {
    firm_status_t status;
    uint8_t *mine;
    size_t begun, inserted, count, room;
    if (size == 0) {
        return FIRM_EMPTY;
    }
    if (is_record(burst, size)) {
        return aborted(joiner, burst[FIRM_HEADER_BYTES]);
    }
    if (burst[0] >= FIRM_PUBLISHERS) {
        return FIRM_BAD_ID;
    }
    if (tid >= 0 && tid != burst[0]) {
        return FIRM_BAD_TID;
    }
    mine = joiner->frames[burst[0]];
    begun = joiner->filled[burst[0]];
    joiner->filled[burst[0]] = 0;
    /* A resumed frame begins with an inserted beat; the bytes after it stay in their lanes. */
    inserted = begun > 0 ? BEAT_BYTES : 0;
    if (begun > 0 && size <= inserted) {
        return FIRM_ONLY_ID;
    }
    count = size - inserted;
    room = ROOM - begun;
    memcpy(mine + begun, burst + inserted, count < room ? count : room);
    status = judged(mine, begun + count);
    if (status == FIRM_FRAME) {
        *frame = mine;
        *frame_bytes = begun + count;
    } else if (status == FIRM_MORE && size % BEAT_BYTES != 0) {
        status = FIRM_WITHIN_BEAT;
    } else if (status == FIRM_MORE) {
        joiner->filled[burst[0]] = begun + count;
    }
    return status;
}

unsigned firm_joiner_close(firm_joiner_t *joiner) {
    unsigned publisher, count = 0;
    for (publisher = 0; publisher < FIRM_PUBLISHERS; ++publisher) {
        count += joiner->filled[publisher] > 0;
        joiner->filled[publisher] = 0;
    }
    return count;
}
