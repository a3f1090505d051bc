/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_link.h"

#include <string.h>

#define CHECKSUM_BYTES 4u
/* The code of a full block, which no zero follows. */
#define FULL_BLOCK 255u
/* The CRC of a frame with its checksum. */
#define RESIDUE 0x2144DF1Cu

uint32_t firm_crc32(uint32_t crc, const uint8_t *bytes, size_t size) {
    /* For the 16 values of four bits, which keeps the table small. */
    static const uint32_t table[16] = {0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
                                       0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
                                       0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};
    size_t place;
    crc = ~crc;
    for (place = 0; place < size; ++place) {
        crc ^= bytes[place];
        crc = crc >> 4 ^ table[crc & 15u];
        crc = crc >> 4 ^ table[crc & 15u];
    }
    return ~crc;
}

/* Return a byte of a frame that is followed by its checksum. */
static uint8_t byte_at(const uint8_t *frame, size_t size, uint32_t checksum, size_t place) {
    if (place < size) {
        return frame[place];
    }
    return (uint8_t)(checksum >> 8 * (place - size) & 0xFFu);
}

void firm_link_encode(const uint8_t *frame, size_t size, void (*put)(void *context, uint8_t byte), void *context) {
    const uint32_t checksum = firm_crc32(0, frame, size);
    const size_t end = size + CHECKSUM_BYTES;
    size_t start = 0;
    int is_over = 0;
    while (!is_over) {
        size_t count = 0, place;
        while (start + count < end && count < FULL_BLOCK - 1u && byte_at(frame, size, checksum, start + count) != 0) {
            ++count;
        }
        put(context, (uint8_t)(count + 1u));
        for (place = start; place < start + count; ++place) {
            put(context, byte_at(frame, size, checksum, place));
        }
        is_over = place == end;
        /* A block that is not full includes the zero after it. */
        start = count == FULL_BLOCK - 1u ? place : place + 1u;
    }
    put(context, 0);
}

void firm_link_decoder_init(firm_link_decoder_t *decoder, uint8_t *buffer, size_t room, unsigned publishers) {
    memset(decoder, 0, sizeof *decoder);
    decoder->buffer = buffer;
    decoder->room = room;
    decoder->publishers = publishers;
}

static void keep(firm_link_decoder_t *decoder, uint8_t byte) {
    if (decoder->size == 0) {
        decoder->filled = 0;
    }
    decoder->crc = firm_crc32(decoder->crc, &byte, 1);
    ++decoder->size;
    if (decoder->filled < decoder->room) {
        decoder->buffer[decoder->filled++] = byte;
    }
}

/* Return the status of a frame that ends now, from its bytes. */
static firm_link_status_t judged(const firm_link_decoder_t *decoder) {
    uint32_t length;
    if (decoder->left != 0 || decoder->size < FIRM_HEADER_BYTES + CHECKSUM_BYTES || decoder->crc != RESIDUE) {
        return FIRM_LINK_BROKEN;
    }
    length = firm_frame_length(decoder->buffer);
    if (decoder->size - FIRM_HEADER_BYTES - CHECKSUM_BYTES != length) {
        return FIRM_LINK_BROKEN;
    }
    if (decoder->buffer[0] >= decoder->publishers || length > decoder->room - FIRM_HEADER_BYTES) {
        return FIRM_LINK_REFUSED;
    }
    return FIRM_LINK_FRAME;
}

static firm_link_status_t end_frame(firm_link_decoder_t *decoder) {
    firm_link_status_t status = decoder->has_begun ? judged(decoder) : FIRM_LINK_MORE;
    if (status == FIRM_LINK_BROKEN && !decoder->is_synchronised) {
        status = FIRM_LINK_MORE;
    }
    decoder->good += status == FIRM_LINK_FRAME;
    decoder->broken += status == FIRM_LINK_BROKEN;
    decoder->refused += status == FIRM_LINK_REFUSED;
    /* The buffer may also hold the first bytes of the checksum. */
    if (status == FIRM_LINK_FRAME) {
        decoder->filled = decoder->size - CHECKSUM_BYTES;
    }
    decoder->crc = 0;
    decoder->size = 0;
    decoder->left = 0;
    decoder->is_zero_due = 0;
    decoder->has_begun = 0;
    decoder->is_synchronised = 1;
    return status;
}

firm_link_status_t firm_link_decoder_push(firm_link_decoder_t *decoder, uint8_t byte) {
    if (byte == 0) {
        return end_frame(decoder);
    }
    decoder->has_begun = 1;
    if (decoder->left == 0) {
        if (decoder->is_zero_due) {
            keep(decoder, 0);
        }
        decoder->left = byte - 1u;
        decoder->is_zero_due = byte != FULL_BLOCK;
    } else {
        --decoder->left;
        keep(decoder, byte);
    }
    return FIRM_LINK_MORE;
}
