/* SPDX-License-Identifier: Apache-2.0 */
/* Frames on a link in C. Each line is a word and bytes in hexadecimal. `encode` prints a frame as it is sent; `decode`
 * gives bytes to the decoder, and prints the frames, and `-` for each that is broken. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firm_link.h"

#define ROOM 70000u

static uint8_t bytes[ROOM], buffer[ROOM];
static char line[2 * ROOM + 20];

static void show(const uint8_t *data, size_t size) {
    size_t place;
    for (place = 0; place < size; ++place) {
        printf("%02x", data[place]);
    }
}

static void put(void *context, uint8_t byte) {
    (void)context;
    show(&byte, 1);
}

static size_t read_bytes(const char *text) {
    size_t size = 0;
    unsigned value;
    while (sscanf(text + 2 * size, "%2x", &value) == 1) {
        bytes[size++] = (uint8_t)value;
    }
    return size;
}

int main(void) {
    firm_link_decoder_t decoder;
    firm_link_decoder_init(&decoder, buffer, sizeof buffer, 256);
    while (fgets(line, sizeof line, stdin)) {
        const size_t size = read_bytes(line + 7);
        size_t place;
        if (strncmp(line, "encode", 6) == 0) {
            firm_link_encode(bytes, size, put, NULL);
        } else {
            for (place = 0; place < size; ++place) {
                const firm_link_status_t status = firm_link_decoder_push(&decoder, bytes[place]);
                if (status == FIRM_LINK_FRAME) {
                    show(decoder.buffer, decoder.filled);
                    printf(" ");
                } else if (status != FIRM_LINK_MORE) {
                    printf("- ");
                }
            }
        }
        printf("\n");
    }
    return 0;
}
