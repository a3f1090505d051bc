/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_frame.h"

#include <string.h>

void firm_frame_header(uint8_t header[FIRM_HEADER_BYTES], uint8_t id, uint32_t length) {
    unsigned place;
    header[0] = id;
    for (place = 1; place < FIRM_HEADER_BYTES; ++place) {
        header[place] = (uint8_t)(length & 0xFFu);
        length >>= 8;
    }
}

uint32_t firm_frame_length(const uint8_t header[FIRM_HEADER_BYTES]) {
    uint32_t length = 0;
    unsigned place;
    for (place = FIRM_HEADER_BYTES - 1; place > 0; --place) {
        length = length << 8 | header[place];
    }
    return length;
}

size_t firm_frame_encode(uint8_t *frame, size_t room, uint8_t id, const uint8_t *payload, size_t size) {
    if (room < FIRM_HEADER_BYTES || size > room - FIRM_HEADER_BYTES || size > UINT32_MAX) {
        return 0;
    }
    firm_frame_header(frame, id, (uint32_t)size);
    if (size > 0) {
        memcpy(frame + FIRM_HEADER_BYTES, payload, size);
    }
    return FIRM_HEADER_BYTES + size;
}

void firm_decoder_init(firm_decoder_t *decoder, uint8_t *buffer, size_t room, unsigned publishers) {
    decoder->buffer = buffer;
    decoder->room = room;
    decoder->publishers = publishers;
    decoder->filled = 0;
}

void firm_decoder_reset(firm_decoder_t *decoder) { decoder->filled = 0; }

/* Return the number of missing bytes: first of the id, then of the header, then of the frame. */
static size_t missing(const firm_decoder_t *decoder) {
    if (decoder->filled == 0) {
        return 1;
    }
    if (decoder->filled < FIRM_HEADER_BYTES) {
        return FIRM_HEADER_BYTES - decoder->filled;
    }
    return FIRM_HEADER_BYTES + (size_t)firm_frame_length(decoder->buffer) - decoder->filled;
}

static firm_status_t judged(const firm_decoder_t *decoder) {
    if (decoder->buffer[0] >= decoder->publishers) {
        return FIRM_BAD_ID;
    }
    if (decoder->filled < FIRM_HEADER_BYTES) {
        return FIRM_MORE;
    }
    if (firm_frame_length(decoder->buffer) > decoder->room - FIRM_HEADER_BYTES) {
        return FIRM_TOO_LONG;
    }
    return missing(decoder) == 0 ? FIRM_FRAME : FIRM_MORE;
}

int firm_decoder_has_begun(const firm_decoder_t *decoder) {
    return decoder->filled > 0 && judged(decoder) == FIRM_MORE;
}

firm_status_t firm_decoder_push(firm_decoder_t *decoder, const uint8_t *bytes, size_t size, size_t *taken) {
    firm_status_t status = FIRM_MORE;
    *taken = 0;
    if (size > 0 && !firm_decoder_has_begun(decoder)) {
        decoder->filled = 0;
    }
    while (status == FIRM_MORE && *taken < size) {
        size_t count = missing(decoder);
        if (count > size - *taken) {
            count = size - *taken;
        }
        memcpy(decoder->buffer + decoder->filled, bytes + *taken, count);
        decoder->filled += count;
        *taken += count;
        status = judged(decoder);
    }
    return status;
}
