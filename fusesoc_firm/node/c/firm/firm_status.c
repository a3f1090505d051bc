/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_status.h"

#define WRITE_BIT 0x80000000u
#define PAYLOAD_BYTES (FIRM_STATUS_FRAME_BYTES - FIRM_HEADER_BYTES)

static void put_word(uint8_t bytes[4], uint32_t word) {
    unsigned place;
    for (place = 0; place < 4; ++place) {
        bytes[place] = (uint8_t)(word & 0xFFu);
        word >>= 8;
    }
}

static uint32_t word_of(const uint8_t bytes[4]) {
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static void write_frame(uint8_t request[FIRM_STATUS_FRAME_BYTES], uint32_t address, uint32_t word) {
    firm_frame_header(request, FIRM_STATUS_ID, PAYLOAD_BYTES);
    put_word(request + FIRM_HEADER_BYTES, address);
    put_word(request + FIRM_HEADER_BYTES + 4, word);
}

void firm_status_read_request(uint8_t request[FIRM_STATUS_FRAME_BYTES], uint32_t address) {
    write_frame(request, address, 0);
}

void firm_status_write_request(uint8_t request[FIRM_STATUS_FRAME_BYTES], uint32_t address, uint32_t word) {
    write_frame(request, address | WRITE_BIT, word);
}

/* The id of two bytes is the one-byte id twice. */
void firm_status_wide_read_request(uint8_t request[FIRM_STATUS_WIDE_FRAME_BYTES], uint32_t address) {
    request[0] = FIRM_STATUS_ID;
    write_frame(request + 1, address, 0);
}

void firm_status_wide_write_request(uint8_t request[FIRM_STATUS_WIDE_FRAME_BYTES], uint32_t address, uint32_t word) {
    request[0] = FIRM_STATUS_ID;
    write_frame(request + 1, address | WRITE_BIT, word);
}

int firm_status_wide_answer(const uint8_t *frame, size_t size, uint32_t *address, uint32_t *word) {
    return size == FIRM_STATUS_WIDE_FRAME_BYTES && frame[0] == FIRM_STATUS_ID &&
           firm_status_answer(frame + 1, size - 1, address, word);
}

int firm_status_answer(const uint8_t *frame, size_t size, uint32_t *address, uint32_t *word) {
    if (size != FIRM_STATUS_FRAME_BYTES || frame[0] != FIRM_STATUS_ID || firm_frame_length(frame) != PAYLOAD_BYTES) {
        return 0;
    }
    *address = word_of(frame + FIRM_HEADER_BYTES) & ~WRITE_BIT;
    *word = word_of(frame + FIRM_HEADER_BYTES + 4);
    return 1;
}
