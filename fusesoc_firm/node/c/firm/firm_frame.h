/* SPDX-License-Identifier: Apache-2.0 */
/* Frames: id (1 byte), length of the payload (4, little-endian), payload. C99, no memory but the caller's. */
#ifndef FIRM_FRAME_H
#define FIRM_FRAME_H

#include <stddef.h>
#include <stdint.h>

#define FIRM_HEADER_BYTES 5u

/* What came of bytes. */
typedef enum {
    FIRM_MORE,         /* no frame is whole yet */
    FIRM_FRAME,        /* one is */
    FIRM_BAD_ID,       /* no such publisher */
    FIRM_TOO_LONG,     /* the frame announces more than there is room for */
    FIRM_EMPTY,        /* a burst without bytes */
    FIRM_BAD_TID,      /* the stream's tid is not the id */
    FIRM_ONLY_ID,      /* a burst that resumes a frame with nothing */
    FIRM_WITHIN_BEAT,  /* a burst that ends within a beat, and its frame is not over */
    FIRM_LONGER        /* a frame is longer than it announces */
} firm_status_t;

/* The header of a frame. */
void firm_frame_header(uint8_t header[FIRM_HEADER_BYTES], uint8_t id, uint32_t length);

/* The length that a header announces. */
uint32_t firm_frame_length(const uint8_t header[FIRM_HEADER_BYTES]);

/* A frame in `frame`: its bytes, or 0 if `room` is too small. */
size_t firm_frame_encode(uint8_t *frame, size_t room, uint8_t id, const uint8_t *payload, size_t size);

/* Finds frames in a row of bytes without marks. `buffer` holds the frame. */
typedef struct {
    uint8_t *buffer;
    size_t room;
    unsigned publishers;
    size_t filled;
} firm_decoder_t;

/* `room` is for a header at least. */
void firm_decoder_init(firm_decoder_t *decoder, uint8_t *buffer, size_t room, unsigned publishers);

/* Take bytes until a frame is whole, or all of them; `taken` is how many. Behind FIRM_FRAME, `buffer` holds `filled`
 * bytes until the next push. Behind an error nobody knows where frames begin: all up to the next mark must be dropped. */
firm_status_t firm_decoder_push(firm_decoder_t *decoder, const uint8_t *bytes, size_t size, size_t *taken);

/* Whether a frame has begun and is not whole. */
int firm_decoder_has_begun(const firm_decoder_t *decoder);

/* Forget the frame that has begun. */
void firm_decoder_reset(firm_decoder_t *decoder);

#endif
