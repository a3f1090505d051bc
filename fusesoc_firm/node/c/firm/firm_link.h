/* SPDX-License-Identifier: Apache-2.0 */
/* Frames on a link that carries bytes (UART, SPI): COBS of the frame and its CRC-32, and a zero byte at the end. C99;
 * all memory is the caller's.
 *
 * A zero byte ends each frame and occurs nowhere else (S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing",
 * 1999). The CRC-32 is that of Ethernet and zlib, lowest byte first. A lost, additional or wrong byte costs the frame
 * in which it occurs, and the next frame if it was the zero byte between them. */
#ifndef FIRM_LINK_H
#define FIRM_LINK_H

#include "firm_frame.h"

/* The CRC-32 of bytes: start with crc 0, and pass the result to the next call. */
uint32_t firm_crc32(uint32_t crc, const uint8_t *bytes, size_t size);

/* Send a frame: `put` is called with `context` and each byte. */
void firm_link_encode(const uint8_t *frame, size_t size, void (*put)(void *context, uint8_t byte), void *context);

typedef enum {
    FIRM_LINK_MORE,    /* no complete frame yet */
    FIRM_LINK_FRAME,   /* a complete frame */
    FIRM_LINK_BROKEN,  /* a frame whose code, length or checksum is wrong is dropped */
    FIRM_LINK_REFUSED  /* a correct frame from an unknown publisher, or longer than the buffer, is dropped */
} firm_link_status_t;

/* Finds frames in received bytes. `buffer` holds the current frame. */
typedef struct {
    uint8_t *buffer;
    size_t room;
    unsigned publishers;
    size_t filled;
    uint32_t crc;
    size_t size;          /* bytes of the frame and its checksum so far */
    unsigned left;        /* bytes of the block still to come; at zero, the code of the next one comes */
    int is_zero_due;      /* a zero follows this block */
    int has_begun;
    int is_synchronised;  /* a zero byte was received */
    uint32_t good;        /* counts of frames */
    uint32_t broken;
    uint32_t refused;
} firm_link_decoder_t;

/* Prepare a decoder; `room` must be sufficient at least for a header. */
void firm_link_decoder_init(firm_link_decoder_t *decoder, uint8_t *buffer, size_t room, unsigned publishers);

/* Read a byte. After FIRM_LINK_FRAME, `buffer` holds `filled` bytes until the next push. Bytes before the first zero
 * byte may be the rest of a frame; they are neither reported nor counted unless they are a whole frame. */
firm_link_status_t firm_link_decoder_push(firm_link_decoder_t *decoder, uint8_t byte);

#endif
