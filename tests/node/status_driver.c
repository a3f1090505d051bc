/* SPDX-License-Identifier: Apache-2.0 */
/* Requests and answers of the status in C: reads all registers of a system. Each request is printed in hexadecimal, and
 * a line with the frame that comes back is read; then each word that is not zero is printed. The first argument is the
 * number of bytes of an id. */
#include <stdio.h>
#include <stdlib.h>

#include "firm_faults.h"
#include "firm_status.h"

static int is_wide;

static uint32_t exchange(uint32_t target, const uint32_t *written) {
    uint8_t request[FIRM_STATUS_WIDE_FRAME_BYTES], frame[FIRM_STATUS_WIDE_FRAME_BYTES];
    uint32_t address = 0, word = 0;
    const unsigned size = is_wide ? FIRM_STATUS_WIDE_FRAME_BYTES : FIRM_STATUS_FRAME_BYTES;
    unsigned place, value;
    char line[100];
    int is_answer;
    if (is_wide && written) {
        firm_status_wide_write_request(request, target, *written);
    } else if (is_wide) {
        firm_status_wide_read_request(request, target);
    } else if (written) {
        firm_status_write_request(request, target, *written);
    } else {
        firm_status_read_request(request, target);
    }
    for (place = 0; place < size; ++place) {
        printf("%02x", request[place]);
    }
    printf("\n");
    fflush(stdout);
    if (!fgets(line, sizeof line, stdin)) {
        exit(1);
    }
    for (place = 0; place < size && sscanf(line + 2 * place, "%2x", &value) == 1; ++place) {
        frame[place] = (uint8_t)value;
    }
    is_answer = is_wide ? firm_status_wide_answer(frame, place, &address, &word)
                        : firm_status_answer(frame, place, &address, &word);
    if (!is_answer || address != target) {
        exit(2);
    }
    return word;
}

static uint32_t word_at(uint32_t address) { return exchange(address, NULL); }

static uint32_t write_word(uint32_t address, uint32_t word) { return exchange(address, &word); }

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

int main(int count, char **arguments) {
    static const char *const names[] = {"control",   "interrupt",   "interrupt_enable", "last_fault",
                                        "id_errors", "link_errors", "lost",             "cycles"};
    static const uint32_t addresses[] = {FIRM_STATUS_CONTROL,          FIRM_STATUS_INTERRUPT,
                                         FIRM_STATUS_INTERRUPT_ENABLE, FIRM_STATUS_LAST_FAULT,
                                         FIRM_STATUS_ID_ERRORS,        FIRM_STATUS_LINK_ERRORS,
                                         FIRM_STATUS_LOST,             FIRM_STATUS_CYCLES};
    unsigned number, subscribers, publishers;
    uint32_t digest[4], shape;
    is_wide = count > 1 && atoi(arguments[1]) == 2;
    shape = word_at(FIRM_STATUS_SHAPE);
    subscribers = shape & 0xFFFu;
    publishers = shape >> 12 & 0xFFFu;
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
    if (write_word(FIRM_STATUS_CONTROL, 0) != 1 || word_at(FIRM_STATUS_CONTROL) != 0) {
        return 4;
    }
    if (write_word(FIRM_STATUS_CONTROL, 1) != 0) {
        return 5;
    }
    return 0;
}
