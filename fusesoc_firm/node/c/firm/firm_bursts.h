/* SPDX-License-Identifier: Apache-2.0 */
/* Joins the bursts of a preemptive Manager into frames (docs/reference/manager.md, "Bursts"), as
 * fusesoc_firm/node/engine/bursts.py does, with a buffer for each publisher. Both are tested with the same bursts. */
#ifndef FIRM_BURSTS_H
#define FIRM_BURSTS_H

#include "firm_config.h"
#include "firm_frame.h"

typedef struct {
    uint8_t frames[FIRM_PUBLISHERS][FIRM_HEADER_BYTES + FIRM_LONGEST_PAYLOAD];
    size_t filled[FIRM_PUBLISHERS]; /* 0: no frame has begun */
} firm_joiner_t;

void firm_joiner_init(firm_joiner_t *joiner);

/* Add a burst. After FIRM_FRAME, `frame` holds a whole frame of `frame_bytes` until the next push of its id. `tid` is
 * the stream's, or negative if the transport has none. After an error, the part of the frame received so far is
 * dropped. A record of AXI DMA that the hardware aborted a frame (cores/axis, firm_axis_abort_record) is an error of that
 * frame. */
firm_status_t firm_joiner_push(firm_joiner_t *joiner, const uint8_t *burst, size_t size, int tid, const uint8_t **frame,
                               size_t *frame_bytes);

/* Drop all incomplete frames and return their number. */
unsigned firm_joiner_close(firm_joiner_t *joiner);

#endif
