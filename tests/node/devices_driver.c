/* The back ends in C before models of AXI DMA and of a Zynq's UART, which the port's registers lead to.
 *
 * `dma COUNT LONGEST SEED FAULT AT`: random frames go out and must come back; the model works when it is looked at, and
 * watches the rules of descriptors and caches. `uart HEX...`: what comes in when, `-` is a silence of 300 ms, `,` of 20; prints the
 * frames that are found, what was sent and how many errors and breaks there were. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firm_dma.h"
#include "firm_uart.h"

#define DMA_BASE 0x40400000u
#define UART_BASE 0xE0000000u
#define BUS_BASE 0x10000000u
#define LONGEST_STREAM 100000u

static uint32_t now;
static const char *fault = "none";
static unsigned fault_at;

static void fail(const char *rule) {
    printf("rule: %s\n", rule);
    exit(0);
}

/* --- AXI DMA -------------------------------------------------------------------------------------------------------- */

static union {
    firm_dma_memory_t shared;
    uint8_t bytes[sizeof(firm_dma_memory_t)];
} real, cached; /* what the engine sees, and what the processor does */

typedef struct {
    uint32_t control, status, current, tail;
    int is_idle;
} channel_t;

static channel_t channels[2];
static uint8_t stream[LONGEST_STREAM]; /* one frame that is in the system */
static size_t stream_bytes, stream_place;
static int stream_is_whole;
static unsigned frames;

static size_t offset_of(uint32_t address, size_t size) {
    if (address < BUS_BASE || address - BUS_BASE + size > sizeof real || address % 64 != 0) {
        fail("an address");
    }
    return address - BUS_BASE;
}

/* A descriptor in the engine's memory. */
static void load(uint32_t address, firm_descriptor_t *descriptor) {
    memcpy(descriptor, real.bytes + offset_of(address, sizeof *descriptor), sizeof *descriptor);
    if ((descriptor->status & 1u << 31) != 0) {
        fail("a descriptor that is complete was handed over");
    }
}

static void advance(channel_t *channel, const firm_descriptor_t *descriptor) {
    memcpy(real.bytes + offset_of(channel->current, sizeof *descriptor), descriptor, sizeof *descriptor);
    channel->is_idle = channel->current == channel->tail;
    channel->current = descriptor->next;
}

static int may_work(const channel_t *channel) {
    return (channel->control & 1u) != 0 && (channel->status & 0x771u) == 0 && !channel->is_idle;
}

static int fetch(void) {
    firm_descriptor_t descriptor;
    size_t size;
    if (!may_work(&channels[0]) || stream_is_whole) {
        return 0;
    }
    load(channels[0].current, &descriptor);
    size = descriptor.control & 0x3FFFFFFu;
    if (((descriptor.control & 1u << 27) != 0) != (stream_bytes == 0)) {
        fail("a frame begins within another one, or none does");
    }
    memcpy(stream + stream_bytes, real.bytes + offset_of(descriptor.buffer, size), size);
    stream_bytes += size;
    stream_is_whole = (descriptor.control & 1u << 26) != 0;
    if (!stream_is_whole && size % 64 != 0) {
        fail("a frame goes on behind half a beat");
    }
    descriptor.status = (uint32_t)size | 1u << 31;
    advance(&channels[0], &descriptor);
    if (stream_is_whole && frames++ == fault_at) {
        channels[0].status |= strcmp(fault, "decode") == 0 ? 1u << 6 | 1u : 0;
        channels[1].status |= strcmp(fault, "slave") == 0 ? 1u << 5 | 1u : 0;
    }
    return 1;
}

static int store(void) {
    firm_descriptor_t descriptor;
    size_t size;
    if (!may_work(&channels[1]) || !stream_is_whole) {
        return 0;
    }
    load(channels[1].current, &descriptor);
    size = stream_bytes - stream_place;
    if (size > (descriptor.control & 0x3FFFFFFu)) {
        size = descriptor.control & 0x3FFFFFFu;
    }
    memcpy(real.bytes + offset_of(descriptor.buffer, size), stream + stream_place, size);
    descriptor.status = (uint32_t)size | 1u << 31 | (stream_place == 0 ? 1u << 27 : 0);
    stream_place += size;
    if (stream_place == stream_bytes) {
        descriptor.status |= 1u << 26;
        stream_bytes = stream_place = 0;
        stream_is_whole = 0;
    }
    advance(&channels[1], &descriptor);
    return 1;
}

static uint32_t read_dma(uint32_t offset) {
    const channel_t *channel = &channels[offset >= 0x30];
    if (offset % 0x30 == 0) {
        return channel->control;
    }
    if (offset % 0x30 != 4) {
        fail("a register that is not read");
    }
    return channel->status | (strcmp(fault, "simple") == 0 ? 0 : 1u << 3);
}

static void write_dma(uint32_t offset, uint32_t value) {
    channel_t *channel = &channels[offset >= 0x30];
    switch (offset % 0x30) {
        case 0x00:
            if ((value & 4u) != 0) {
                const channel_t reset = {0, 1, 0, 0, 1};
                channels[0] = channels[1] = reset;
                channels[0].control = strcmp(fault, "reset") == 0 || strcmp(fault, "frozen") == 0 ? 4u : 0;
            } else {
                channel->control = value;
                channel->status &= ~1u;
            }
            break;
        case 0x04:
            channel->status &= ~(value & 0x7000u);
            break;
        case 0x08:
            channel->current = value;
            break;
        case 0x10:
            channel->tail = value;
            channel->is_idle = 0;
            break;
        default:
            fail("a register that is not written");
    }
}

/* --- UART ----------------------------------------------------------------------------------------------------------- */

static char **script; /* what comes, piece by piece */
static size_t script_place;
static unsigned breaks;
static char sent[4096];

/* The next byte that comes; a silence has passed when the clock says so. */
static int next_byte(void) {
    unsigned value;
    static uint32_t silent_until;
    while (*script && (strchr("-,", **script) || (*script)[script_place] == 0)) {
        if (strchr("-,", **script)) {
            silent_until = silent_until == 0 ? now + (**script == '-' ? 300u : 20u) : silent_until;
            if (now < silent_until) {
                return -1;
            }
            silent_until = 0;
        }
        ++script;
        script_place = 0;
    }
    return *script && sscanf(*script + script_place, "%2x", &value) == 1 ? (int)value : -1;
}

static uint32_t read_uart(uint32_t offset) {
    if (offset == 0x30) {
        const int byte = next_byte();
        script_place += 2;
        return (uint32_t)byte;
    }
    /* The register of interrupts shows no lost byte. */
    return offset == 0x14 ? 0 : 0x08u | (next_byte() < 0 ? 0x02u : 0);
}

static void write_uart(uint32_t offset, uint32_t value) {
    if (offset == 0x30) {
        sprintf(sent + strlen(sent), "%02x", (unsigned)value);
    } else if (offset == 0) {
        breaks += (value & 0x80u) != 0;
    }
}

/* --- the port ------------------------------------------------------------------------------------------------------- */

uint32_t firm_read(uintptr_t address) {
    return address >= UART_BASE ? read_uart((uint32_t)(address - UART_BASE)) : read_dma((uint32_t)(address - DMA_BASE));
}

void firm_write(uintptr_t address, uint32_t value) {
    if (address >= UART_BASE) {
        write_uart((uint32_t)(address - UART_BASE), value);
    } else {
        write_dma((uint32_t)(address - DMA_BASE), value);
        while (store() || fetch()) {
        }
    }
}

static size_t cached_place(const volatile void *memory, size_t size) {
    const size_t place = (size_t)((const volatile uint8_t *)memory - cached.bytes);
    if (place + size > sizeof cached) {
        fail("a cache operation beyond the memory that is shared");
    }
    return place;
}

void firm_cache_flush(const volatile void *memory, size_t size) {
    const size_t place = cached_place(memory, size);
    memcpy(real.bytes + place, cached.bytes + place, size);
}

void firm_cache_invalidate(const volatile void *memory, size_t size) {
    const size_t place = cached_place(memory, size);
    memcpy(cached.bytes + place, real.bytes + place, size);
}

uint64_t firm_bus_address(const volatile void *memory) {
    const uint64_t further = strcmp(fault, "high") == 0 ? (uint64_t)1 << 32 : strcmp(fault, "border") == 0 ? 0xEFFFFFC0u : 0;
    return BUS_BASE + further + cached_place(memory, 0) + (strcmp(fault, "unaligned") == 0);
}

void firm_lock(firm_lock_t *lock) { (void)lock; }
void firm_unlock(firm_lock_t *lock) { (void)lock; }
uint32_t firm_milliseconds(void) { return now; }
void firm_pause(void) { now += strcmp(fault, "frozen") != 0; }

/* --- what is played ------------------------------------------------------------------------------------------------- */

static uint8_t frame[LONGEST_STREAM], burst[LONGEST_STREAM];

static int play_dma(char **words) {
    static const char *const names[] = {"ok", "nothing", "burst", "too_long", "stuck", "no_sg", "error", "memory"};
    const int count = atoi(words[0]);
    const unsigned longest = (unsigned)atoi(words[1]);
    firm_dma_status_t status;
    firm_dma_t dma;
    int number;
    srand((unsigned)atoi(words[2]));
    fault = words[3];
    fault_at = (unsigned)atoi(words[4]);
    status = firm_dma_open(&dma, DMA_BASE, &cached.shared);
    for (number = 0; status == FIRM_DMA_OK && number < count; ++number) {
        size_t size = 0, place, length = (size_t)rand() % (longest + 1);
        for (place = 0; place < length; ++place) {
            burst[place] = (uint8_t)rand();
        }
        length = firm_frame_encode(frame, sizeof frame, (uint8_t)rand(), burst, length);
        status = firm_dma_send(&dma, frame, length);
        if (status != FIRM_DMA_OK) {
            break;
        }
        firm_dma_answer_interrupt(&dma);
        do {
            status = firm_dma_receive(&dma, burst, strcmp(fault, "room") == 0 ? 50 : sizeof burst, &size);
        } while (status == FIRM_DMA_NOTHING && now++ < 1000000);
        if (status != FIRM_DMA_BURST) {
            break;
        }
        status = FIRM_DMA_OK;
        if (size != length || memcmp(frame, burst, size) != 0) {
            fail("a burst differs");
        }
    }
    printf("%s %d %x %x\n", names[status], number, firm_dma_fault(&dma, 1), firm_dma_fault(&dma, 0));
    firm_dma_close(&dma);
    return 0;
}

static int play_uart(char **words) {
    firm_uart_t uart;
    const uint8_t hello[] = {0, 1, 0, 0, 0, 0xAA};
    const uint32_t end = 5000;
    script = words;
    firm_uart_open(&uart, UART_BASE, frame, FIRM_HEADER_BYTES + 64, 2);
    while (now < end) {
        const firm_link_status_t status = firm_uart_receive(&uart);
        if (status == FIRM_LINK_FRAME) {
            size_t place;
            for (place = 0; place < uart.decoder.filled; ++place) {
                printf("%02x", uart.decoder.buffer[place]);
            }
            printf(" ");
        } else if (status == FIRM_LINK_MORE) {
            firm_pause();
        }
    }
    firm_uart_send(&uart, hello, sizeof hello);
    printf("good %u broken %u refused %u ", (unsigned)uart.decoder.good, (unsigned)uart.decoder.broken,
           (unsigned)uart.decoder.refused);
    printf("breaks %u sent %s\n", breaks, sent);
    return 0;
}

int main(int count, char **words) {
    return count > 1 && strcmp(words[1], "dma") == 0 ? play_dma(words + 2) : play_uart(words + 2);
}
