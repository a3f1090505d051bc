/* Speaks for framing, bursts and queues in C, with the sizes that it is compiled for. A line for each `encode ID HEX`,
 * `decoder PUBLISHERS ROOM`, `bytes HEX`, `joiner`, `push TID HEX`, `close`, `queues`, `put SUBSCRIBER HEX`, `get`; each
 * line of input gives one of output. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firm_bursts.h"
#include "firm_frame.h"
#include "firm_queues.h"

#ifdef STAND_IN
#include "task.h"
int stand_in_critical, stand_in_scheduler = taskSCHEDULER_RUNNING;
TickType_t stand_in_ticks;
#endif

static const char *const names[] = {"more",    "frame",   "bad_id",      "too_long", "empty",
                                    "bad_tid", "only_id", "within_beat", "longer",   "aborted"};
static char line[1 << 16];
static uint8_t bytes[1 << 15];
static uint8_t buffer[1 << 15];
static firm_joiner_t joiner;
static firm_queues_t queues;

static size_t from_hex(const char *text) {
    size_t size = 0;
    unsigned value;
    while (sscanf(text + 2 * size, "%2x", &value) == 1) {
        bytes[size++] = (uint8_t)value;
    }
    return size;
}

static void print_hex(const uint8_t *data, size_t size) {
    size_t place;
    for (place = 0; place < size; ++place) {
        printf("%02x", data[place]);
    }
}

static void decode(firm_decoder_t *decoder, size_t size) {
    size_t place = 0;
    printf("decoded");
    while (place < size) {
        size_t taken;
        const firm_status_t status = firm_decoder_push(decoder, bytes + place, size - place, &taken);
        place += taken;
        if (status == FIRM_FRAME) {
            printf(" ");
            print_hex(decoder->buffer, decoder->filled);
        } else if (status != FIRM_MORE) {
            printf(" %s", names[status]);
            firm_decoder_reset(decoder);
            break;
        }
    }
    printf("\n");
}

static void push(const char *word, size_t size) {
    const uint8_t *frame;
    size_t frame_bytes;
    const int tid = strcmp(word, "-") == 0 ? -1 : atoi(word);
    const firm_status_t status = firm_joiner_push(&joiner, bytes, size, tid, &frame, &frame_bytes);
    printf("%s", names[status]);
    if (status == FIRM_FRAME) {
        printf(" ");
        print_hex(frame, frame_bytes);
    }
    printf("\n");
}

static void get(void) {
    firm_next_t next;
    if (!firm_queues_get(&queues, &next)) {
        printf("empty\n");
        return;
    }
    printf("%u ", next.subscriber);
    print_hex(next.frame, next.size);
    printf("\n");
    firm_queues_release(&queues, &next);
}

int main(void) {
    firm_decoder_t decoder;
    firm_decoder_init(&decoder, buffer, sizeof buffer, 256);
    while (fgets(line, sizeof line, stdin)) {
        char command[16] = "", word[16] = "";
        int place = 0;
        size_t size;
        line[strcspn(line, "\n")] = 0;
        sscanf(line, "%15s %15s %n", command, word, &place);
        size = from_hex(place > 0 ? line + place : "");
        if (strcmp(command, "encode") == 0) {
            print_hex(buffer, firm_frame_encode(buffer, FIRM_HEADER_BYTES + FIRM_LONGEST_PAYLOAD,
                                                (uint8_t)atoi(word), bytes, size));
            printf("\n");
        } else if (strcmp(command, "decoder") == 0) {
            firm_decoder_init(&decoder, buffer, (size_t)atoi(line + place), (unsigned)atoi(word));
            printf("ready\n");
        } else if (strcmp(command, "bytes") == 0) {
            decode(&decoder, from_hex(line + strlen("bytes ")));
        } else if (strcmp(command, "joiner") == 0) {
            firm_joiner_init(&joiner);
            printf("ready\n");
        } else if (strcmp(command, "push") == 0) {
            push(word, size);
        } else if (strcmp(command, "close") == 0) {
            printf("closed %u\n", firm_joiner_close(&joiner));
        } else if (strcmp(command, "queues") == 0) {
            firm_queues_init(&queues);
            printf("ready\n");
        } else if (strcmp(command, "put") == 0) {
            const unsigned subscriber = (unsigned)atoi(word);
            const int is_kept = firm_queues_put(&queues, subscriber, bytes, size);
            printf("%s %u\n", is_kept ? "kept" : "refused", is_kept ? (unsigned)queues.dropped[subscriber] : 0);
        } else {
            get();
        }
    }
    return 0;
}
