/* SPDX-License-Identifier: Apache-2.0 */
/* Parameters in C: writes a word to the parameter of a number, then reads the word in effect. Each request is printed in
 * hexadecimal, and a line with the frame that comes back is read; then the word in effect is printed. */
#include <stdio.h>
#include <stdlib.h>

#include "firm_status.h"

static uint32_t exchange(const uint8_t request[FIRM_STATUS_FRAME_BYTES]) {
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
    for (place = 0; place < sizeof frame && sscanf(line + 2 * place, "%2x", &value) == 1; ++place) {
        frame[place] = (uint8_t)value;
    }
    if (!firm_status_answer(frame, place, &address, &word)) {
        exit(2);
    }
    return word;
}

int main(int argc, char **argv) {
    uint8_t request[FIRM_STATUS_FRAME_BYTES];
    uint32_t number, wanted;
    if (argc != 3) {
        return 3;
    }
    number = (uint32_t)strtoul(argv[1], NULL, 10);
    wanted = (uint32_t)strtoul(argv[2], NULL, 10);
    firm_status_write_request(request, FIRM_STATUS_PARAMETER_WANTED(number), wanted);
    (void)exchange(request);
    firm_status_read_request(request, FIRM_STATUS_PARAMETER(number));
    printf("= effect %lu\n", (unsigned long)exchange(request));
    return 0;
}
