/* SPDX-License-Identifier: Apache-2.0 */
/* Requests and answers of the status in C: reads all registers of a system. Each request is printed in hexadecimal, and
 * a line with the frame that comes back is read; then each word that is not zero is printed. */
#include <stdio.h>
#include <stdlib.h>

#include "firm_faults.h"
#include "firm_status.h"

static uint32_t answer_to(const uint8_t request[FIRM_STATUS_FRAME_BYTES], uint32_t expected) {
    uint8_t frame[FIRM_STATUS_FRAME_BYTES];
    uint32_t address = 0, word = 0;
    unsigned place, value;
    char line[100];
    for (place = 0; place < FIRM_STATUS_FRAME_BYTES; ++place) {
        printf("%02x", request[place]);
    }
    printf("\n");
    fflush(stdout);
    if (!fgets(line, sizeof line, stdin)) {
        exit(1);
    }
    for (place = 0; place < FIRM_STATUS_FRAME_BYTES && sscanf(line + 2 * place, "%2x", &value) == 1; ++place) {
        frame[place] = (uint8_t)value;
    }
    if (!firm_status_answer(frame, place, &address, &word) || address != expected) {
        exit(2);
    }
    return word;
}

static uint32_t word_at(uint32_t address) {
    uint8_t request[FIRM_STATUS_FRAME_BYTES];
    firm_status_read_request(request, address);
    return answer_to(request, address);
}

static void show(const char *name, unsigned number, const char *field, uint32_t word) {
    if (word > 0) {
        printf("= %s[%u].%s %lu\n", name, number, field, (unsigned long)word);
    }
}

static void show_channel(const char *name, unsigned number, unsigned channel) {
    unsigned code;
    char field[20];
    show(name, number, "frames", word_at(FIRM_STATUS_CHANNEL(channel) + FIRM_STATUS_FRAMES));
    show(name, number, "longest_wait", word_at(FIRM_STATUS_CHANNEL(channel) + FIRM_STATUS_LONGEST_WAIT));
    show(name, number, "stamp", word_at(FIRM_STATUS_CHANNEL(channel) + FIRM_STATUS_STAMP));
    for (code = FIRM_FAULT_BAD_LENGTH; code <= FIRM_FAULT_BAD_CHECKSUM; ++code) {
        snprintf(field, sizeof field, "faults[%u]", code - 1);
        show(name, number, field, word_at(FIRM_STATUS_CHANNEL(channel) + FIRM_STATUS_FAULTS(code)));
    }
}

int main(void) {
    static const char *const names[] = {"control",   "interrupt",   "interrupt_enable", "last_fault",
                                        "id_errors", "link_errors", "lost",             "cycles"};
    static const uint32_t addresses[] = {FIRM_STATUS_CONTROL,          FIRM_STATUS_INTERRUPT,
                                         FIRM_STATUS_INTERRUPT_ENABLE, FIRM_STATUS_LAST_FAULT,
                                         FIRM_STATUS_ID_ERRORS,        FIRM_STATUS_LINK_ERRORS,
                                         FIRM_STATUS_LOST,             FIRM_STATUS_CYCLES};
    const uint32_t shape = word_at(FIRM_STATUS_SHAPE);
    const unsigned subscribers = shape & 0xFFFu, publishers = shape >> 12 & 0xFFFu;
    unsigned number;
    uint32_t digest[4];
    uint8_t request[FIRM_STATUS_FRAME_BYTES];
    if (word_at(FIRM_STATUS_MAGIC) != FIRM_STATUS_MARK || (word_at(FIRM_STATUS_FEATURES) & 1u) == 0) {
        return 3;
    }
    for (number = 0; number < sizeof addresses / sizeof addresses[0]; ++number) {
        const uint32_t word = word_at(addresses[number]);
        if (word > 0) {
            printf("= %s %lu\n", names[number], (unsigned long)word);
        }
    }
    for (number = 0; number < 4; ++number) {
        digest[number] = word_at(FIRM_STATUS_DIGEST(number));
    }
    printf("= digest ");
    for (number = 4; number-- > 0;) {
        printf("%08lx", (unsigned long)digest[number]);
    }
    printf("\n");
    for (number = 0; number < subscribers; ++number) {
        show_channel("subscriber", number, number);
    }
    for (number = 0; number < publishers; ++number) {
        show_channel("publisher", number, subscribers + number);
    }
    /* Counting can be switched off and on. */
    firm_status_write_request(request, FIRM_STATUS_CONTROL, 0);
    if (answer_to(request, FIRM_STATUS_CONTROL) != 1 || word_at(FIRM_STATUS_CONTROL) != 0) {
        return 4;
    }
    firm_status_write_request(request, FIRM_STATUS_CONTROL, 1);
    if (answer_to(request, FIRM_STATUS_CONTROL) != 0) {
        return 5;
    }
    return 0;
}
