/* SPDX-License-Identifier: Apache-2.0 */
#include "firm_player.h"

#include <string.h>

#include "firm_board.h"
#include "firm_limit.h"
#include "firm_queues.h"
#include "firm_uart.h"

/* The link is silent when nothing has moved for this time. */
#define SILENT_MS 100u
#define LINE_BYTES 64u

static firm_queues_t queues;
static firm_uart_t uart;
static uint8_t buffer[FIRM_HEADER_BYTES + FIRM_LONGEST_PAYLOAD];
static const uint32_t *next_message;
static uint32_t left; /* messages that are not queued yet */
static volatile uint32_t queued, sent;
static uint32_t lost;
static firm_limit_t silence;
static int is_reported;

static void answer_interrupt(void *context) { firm_uart_answer_interrupt(context); }

void firm_player_open(void) {
    const uint32_t *messages = (const uint32_t *)FIRM_PLAYER_MESSAGES;
    left = messages[0];
    next_message = messages + 1;
    firm_queues_init(&queues);
    firm_uart_open(&uart, FIRM_BOARD_UART, buffer, sizeof buffer, FIRM_PUBLISHERS);
    firm_board_connect(FIRM_BOARD_UART_INTERRUPT, answer_interrupt, &uart);
    firm_uart_use_interrupt(&uart);
    silence = firm_limit_of(SILENT_MS);
}

int firm_player_put(void) {
    uint32_t size;
    if (left == 0 || queued != sent) {
        return 0;
    }
    size = next_message[1];
    if (!firm_queues_put(&queues, next_message[0], (const uint8_t *)(next_message + 2), size)) {
        firm_board_say("a message does not fit its queue\n");
        left = 0;
        return 0;
    }
    next_message += 2 + (size + 3) / 4;
    --left;
    ++queued;
    return 1;
}

static void say_frame(const uint8_t *bytes, size_t size) {
    static const char digits[] = "0123456789abcdef";
    char line[2 * LINE_BYTES + 1];
    size_t filled = 0;
    size_t place;
    firm_board_say("frame ");
    for (place = 0; place < size; ++place) {
        line[filled++] = digits[bytes[place] >> 4];
        line[filled++] = digits[bytes[place] & 15u];
        if (filled == 2 * LINE_BYTES || place + 1 == size) {
            line[filled] = '\0';
            firm_board_say(line);
            filled = 0;
        }
    }
    firm_board_say("\n");
}

static void say_count(const char *name, uint32_t count) {
    char digits[11];
    size_t place = sizeof digits - 1;
    digits[place] = '\0';
    do {
        digits[--place] = (char)('0' + count % 10);
        count /= 10;
    } while (count != 0);
    firm_board_say(name);
    firm_board_say(digits + place);
}

static void say_counts(void) {
    say_count("counts sent=", sent);
    say_count(" lost=", lost);
    say_count(" good=", uart.decoder.good);
    say_count(" broken=", uart.decoder.broken);
    say_count(" refused=", uart.decoder.refused);
    say_count(" overruns=", uart.overruns);
    firm_board_say("\n");
}

static int send(void) {
    firm_next_t next;
    if (!firm_queues_get(&queues, &next)) {
        return 0;
    }
    if (!firm_uart_send(&uart, next.frame, next.size)) {
        ++lost;
    }
    firm_queues_release(&queues, &next);
    ++sent;
    return 1;
}

static int receive(void) {
    int has_moved = 0;
    firm_link_status_t status;
    while ((status = firm_uart_receive(&uart)) != FIRM_LINK_MORE) {
        has_moved = 1;
        if (status == FIRM_LINK_FRAME) {
            say_frame(uart.decoder.buffer, uart.decoder.filled);
        }
    }
    return has_moved;
}

int firm_player_carry(void) {
    int has_moved = send();
    has_moved |= receive();
    if (has_moved) {
        silence = firm_limit_of(SILENT_MS);
        is_reported = 0;
    } else if (!is_reported && firm_limit_is_over(&silence)) {
        say_counts();
        is_reported = 1;
    }
    return has_moved;
}
