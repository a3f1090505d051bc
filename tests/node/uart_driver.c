/* The UART's driver in C before a model of a Zynq's UART: FIFOs of 64 bytes, in which bytes arrive and leave at 1 Mbaud
 * while the program runs. Time passes with each access to a register.
 *
 * `COUNT SEED MODE...`: COUNT frames of 32 to 1,024 bytes go each way as fast as the line takes them. Modes: `interrupt`
 * moves received bytes by the interrupt; `flow` uses RTS and CTS; `slow` is away for up to 5 ms between two frames;
 * `held` is a board that takes no bytes; `frozen` is a clock that never counts. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firm_uart.h"

#ifdef STAND_IN
#include "task.h"
int stand_in_critical, stand_in_scheduler;
TickType_t stand_in_ticks;
#else
extern volatile uint32_t firm_ticks;
#endif

#define BASE 0xE0001000u
#define DEPTH 64u
#define BYTE_NS 10000u
#define LAG 16u /* bytes that the board sends after RTS has risen */
#define SHORTEST 32u
#define LONGEST 1024u
#define ROOM (FIRM_HEADER_BYTES + LONGEST)

typedef struct {
    uint8_t bytes[DEPTH];
    unsigned first, count;
} fifo_t;

static uint64_t now, rx_at, tx_at, silent_since; /* in ns */
static fifo_t rx, tx;
static uint32_t pending, enabled, trigger = 1, silent_time, modem, flow_delay = DEPTH;
static unsigned lag, breaks; /* that have ended: the board sends after one */
static int is_answering, is_held, is_frozen, is_slow;
static uint32_t generator;

static firm_uart_t uart;
static uint8_t uart_buffer[ROOM];

/* The board: what it sends, and what it finds in what it receives. */
static uint8_t coded[2 * ROOM];
static size_t coded_size, coded_place;
static unsigned board_sent, board_good, board_wrong, total;
static firm_link_decoder_t board;
static uint8_t board_buffer[ROOM];

static uint32_t draw(uint32_t below) {
    generator = generator * 1664525u + 1013904223u;
    return (uint32_t)((uint64_t)generator * below >> 32);
}

/* The frame of a number, in a direction; the same for who sends it and who compares it. */
static size_t frame_of(uint8_t frame[ROOM], unsigned number, uint32_t direction) {
    uint8_t payload[LONGEST];
    const uint32_t kept = generator;
    size_t size, place;
    generator = 2 * number + direction;
    size = SHORTEST + draw(LONGEST - SHORTEST + 1);
    for (place = 0; place < size; ++place) {
        payload[place] = (uint8_t)(draw(4) == 0 ? 0 : draw(256));
    }
    generator = kept;
    return firm_frame_encode(frame, ROOM, 0, payload, size);
}

static int is_frame(const uint8_t *found, size_t size, unsigned number, uint32_t direction) {
    uint8_t frame[ROOM];
    return frame_of(frame, number, direction) == size && memcmp(frame, found, size) == 0;
}

/* --- the model ------------------------------------------------------------------------------------------------------ */

static void push(fifo_t *fifo, uint8_t byte) { fifo->bytes[(fifo->first + fifo->count++) % DEPTH] = byte; }

static uint8_t pop(fifo_t *fifo) {
    const uint8_t byte = fifo->bytes[fifo->first];
    fifo->first = (fifo->first + 1) % DEPTH;
    --fifo->count;
    return byte;
}

static void keep_coded(void *context, uint8_t byte) {
    (void)context;
    coded[coded_size++] = byte;
}

static int board_may_send(void) {
    if (coded_place == coded_size && board_sent < total) {
        uint8_t frame[ROOM];
        const size_t size = frame_of(frame, board_sent++, 1);
        coded_size = coded_place = 0;
        firm_link_encode(frame, size, keep_coded, NULL);
    }
    if ((modem & 0x20u) == 0 || rx.count < flow_delay) {
        lag = 0;
    }
    return breaks > 0 && coded_place < coded_size && lag <= LAG;
}

static void receive_byte(void) {
    lag += (modem & 0x20u) != 0 && rx.count >= flow_delay;
    if (rx.count == DEPTH) {
        pending |= 0x20u;
    } else {
        push(&rx, coded[coded_place]);
    }
    ++coded_place;
    silent_since = now;
}

static void send_byte(void) {
    if (firm_link_decoder_push(&board, pop(&tx)) == FIRM_LINK_FRAME) {
        board_wrong += (unsigned)!is_frame(board.buffer, board.filled, board_good, 0);
        ++board_good;
    }
}

static void interrupt(void) {
    pending |= rx.count >= trigger ? 0x01u : 0;
    pending |= silent_time > 0 && rx.count > 0 && now - silent_since > silent_time * 4u * BYTE_NS / 10u ? 0x100u : 0;
    if ((pending & enabled) != 0 && !is_answering) {
        is_answering = 1;
        firm_uart_answer_interrupt(&uart);
        is_answering = 0;
    }
}

static void count_ticks(void) {
#ifdef STAND_IN
    stand_in_ticks = is_frozen ? stand_in_ticks : (TickType_t)(now / 1000000u / portTICK_PERIOD_MS);
#else
    firm_ticks = is_frozen ? 0 : (uint32_t)(now / 1000000u);
#endif
}

/* One byte time at a time, or less. */
static void advance(uint64_t nanoseconds) {
    const uint64_t end = now + nanoseconds;
    while (now < end) {
        now = end - now > BYTE_NS ? now + BYTE_NS : end;
        if (now - rx_at >= BYTE_NS && board_may_send()) {
            rx_at = now - rx_at >= 2 * BYTE_NS ? now : rx_at + BYTE_NS;
            receive_byte();
        }
        if (now - tx_at >= BYTE_NS && tx.count > 0 && !is_held) {
            tx_at = now - tx_at >= 2 * BYTE_NS ? now : tx_at + BYTE_NS;
            send_byte();
        }
        count_ticks();
        interrupt();
    }
}

static void access(void) {
#ifdef STAND_IN
    const uint64_t waited = (uint64_t)stand_in_ticks * portTICK_PERIOD_MS * 1000000u;
    if (!is_frozen && waited > now) {
        advance(waited - now);
    }
#endif
    advance(100u + draw(200));
}

uint32_t firm_read(uintptr_t address) {
    access();
    switch (address - BASE) {
        case 0x14:
            return pending;
        case 0x2C:
            return (rx.count == 0 ? 0x02u : 0) | (tx.count == 0 ? 0x08u : 0) | (tx.count == DEPTH ? 0x10u : 0);
        case 0x30:
            return rx.count > 0 ? pop(&rx) : 0;
        default:
            printf("rule: a register that is not read\n");
            exit(0);
    }
}

void firm_write(uintptr_t address, uint32_t value) {
    access();
    switch (address - BASE) {
        case 0x00:
            breaks += (value & 0x100u) != 0;
            silent_since = (value & 0x40u) != 0 ? now : silent_since;
            break;
        case 0x08:
            enabled |= value;
            break;
        case 0x0C:
            enabled &= ~value;
            break;
        case 0x14:
            pending &= ~value;
            break;
        case 0x1C:
            silent_time = value;
            break;
        case 0x20:
            trigger = value;
            break;
        case 0x24:
            modem = value;
            break;
        case 0x30:
            if (tx.count == DEPTH) {
                printf("rule: a byte for a full FIFO\n");
                exit(0);
            }
            push(&tx, (uint8_t)value);
            break;
        case 0x38:
            flow_delay = value;
            break;
        default:
            printf("rule: a register that is not written\n");
            exit(0);
    }
}

/* --- the program ---------------------------------------------------------------------------------------------------- */

static unsigned good, wrong, next_number;

/* A frame that arrives is the next one that was sent, or one after it where some were lost. */
static void judge_frame(void) {
    while (next_number < board_sent && !is_frame(uart.decoder.buffer, uart.decoder.filled, next_number, 1)) {
        ++next_number;
    }
    wrong += next_number == board_sent;
    ++next_number;
    ++good;
}

static void receive_all(void) {
    firm_link_status_t status = firm_uart_receive(&uart);
    while (status != FIRM_LINK_MORE) {
        if (status == FIRM_LINK_FRAME) {
            judge_frame();
        }
        status = firm_uart_receive(&uart);
    }
}

int main(int count, char **words) {
    unsigned number, lost = 0;
    uint64_t last;
    int word, has_flow = 0, has_interrupt = 0;
    total = (unsigned)atoi(words[1]);
    generator = (uint32_t)atoi(words[2]);
    for (word = 3; word < count; ++word) {
        has_flow |= strcmp(words[word], "flow") == 0;
        has_interrupt |= strcmp(words[word], "interrupt") == 0;
        is_slow |= strcmp(words[word], "slow") == 0;
        is_held |= strcmp(words[word], "held") == 0;
        is_frozen |= strcmp(words[word], "frozen") == 0;
    }
    firm_link_decoder_init(&board, board_buffer, sizeof board_buffer, 1);
    firm_uart_open(&uart, BASE, uart_buffer, sizeof uart_buffer, 1);
#ifdef STAND_IN
    stand_in_scheduler = taskSCHEDULER_RUNNING;
#endif
    if (has_flow) {
        firm_uart_use_flow_control(&uart);
    }
    if (has_interrupt) {
        firm_uart_use_interrupt(&uart);
    }
    for (number = 0; number < total; ++number) {
        uint8_t frame[ROOM];
        lost += (unsigned)!firm_uart_send(&uart, frame, frame_of(frame, number, 0));
        receive_all();
        if (is_slow) {
            advance(draw(5000000));
        }
    }
    /* What is under way arrives within 20 ms. */
    for (last = now; now - last < 20000000u;) {
        const unsigned before = good;
        (void)firm_read(BASE + 0x2Cu);
        receive_all();
        last = good != before ? now : last;
    }
    printf("good %u wrong %u broken %u overruns %u ", good, wrong, (unsigned)uart.decoder.broken,
           (unsigned)uart.overruns);
    printf("board %u wrong %u broken %u lost %u\n", board_good, board_wrong, (unsigned)board.broken, lost);
    return 0;
}
