/* SPDX-License-Identifier: Apache-2.0 */
/* Frames: id (1 byte), length of the payload (4 bytes, little-endian), payload. C99; all memory is the caller's. */
#ifndef FIRM_FRAME_H
#define FIRM_FRAME_H

#include <stddef.h>
#include <stdint.h>

#define FIRM_HEADER_BYTES 5u

/* The result of reading bytes. */
typedef enum {
    FIRM_MORE,         /* no complete frame yet */
    FIRM_FRAME,        /* a complete frame */
    FIRM_BAD_ID,       /* unknown publisher */
    FIRM_TOO_LONG,     /* the frame announces more than its buffer can hold */
    FIRM_EMPTY,        /* a burst without bytes */
    FIRM_BAD_TID,      /* the stream's tid differs from the id */
    FIRM_ONLY_ID,      /* a burst that resumes a frame but adds nothing */
    FIRM_WITHIN_BEAT,  /* a burst that ends in the middle of a beat although its frame is incomplete */
    FIRM_LONGER,       /* more bytes than the frame announces */
    FIRM_ABORTED       /* the hardware aborted the frame */
} firm_status_t;

/* Write the header of a frame. */
void firm_frame_header(uint8_t header[FIRM_HEADER_BYTES], uint8_t id, uint32_t length);

/* Return the length that a header announces. */
uint32_t firm_frame_length(const uint8_t header[FIRM_HEADER_BYTES]);

/* Write a frame to `frame`. Returns its number of bytes, or 0 if `room` is too small. */
size_t firm_frame_encode(uint8_t *frame, size_t room, uint8_t id, const uint8_t *payload, size_t size);

/* Finds frames in a byte stream without markers. `buffer` holds the current frame. */
typedef struct {
    uint8_t *buffer;
    size_t room;
    unsigned publishers;
    size_t filled;
} firm_decoder_t;

/* Prepare a decoder; `room` must be sufficient at least for a header. */
void firm_decoder_init(firm_decoder_t *decoder, uint8_t *buffer, size_t room, unsigned publishers);

/* Read bytes until a frame is complete or no bytes are left; `taken` is their number. After FIRM_FRAME, `buffer` holds
 * `filled` bytes until the next push. After an error, the beginnings of frames are unknown: drop all bytes up to the
 * next marker. */
firm_status_t firm_decoder_push(firm_decoder_t *decoder, const uint8_t *bytes, size_t size, size_t *taken);

/* Return whether a frame has begun but is not complete. */
int firm_decoder_has_begun(const firm_decoder_t *decoder);

/* Drop the incomplete frame. */
void firm_decoder_reset(firm_decoder_t *decoder);

#endif
