/* The back ends in C: AXI DMA before the model in dma_engine.py, and a UART before a model of a Zynq's.
 *
 * `dma ROOT COUNT LONGEST SEED HOW`: random frames go out and must come back, through the registers at ROOT/registers and
 * the memory ROOT/dev/udmabuf0, which the processor sees only through its caches. HOW is `plain` or one of the cases in
 * this file. `uart HEX...`: what comes in when, `-` is a silence of 300 ms, `,` of 20; prints the frames that are found,
 * what was sent and how many errors and breaks there were. */
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "engine_client.h"
#include "firm_dma.h"
#include "firm_uart.h"

#define DMA_BASE 0x40400000u
#define UART_BASE 0xE0000000u
#ifndef BUS_BASE
#define BUS_BASE 0x10000000u
#endif
#define LONGEST_STREAM 100000u

static uint32_t now;
static const char *how = "plain";

static void fail(const char *rule) {
    printf("rule: %s\n", rule);
    exit(0);
}

/* --- AXI DMA -------------------------------------------------------------------------------------------------------- */

static uint8_t *real; /* what the engine sees */
static union {
    firm_dma_memory_t shared;
    uint8_t bytes[sizeof(firm_dma_memory_t)];
} cached; /* what the processor sees */
static int engine;

static void open_board(const char *root) {
    char path[256];
    int memory;
    snprintf(path, sizeof path, "%s/registers", root);
    engine = engine_connect(path);
    snprintf(path, sizeof path, "%s/dev/udmabuf0", root);
    memory = open(path, O_RDWR);
    real = mmap(NULL, sizeof cached, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
    if (memory < 0 || real == MAP_FAILED) {
        fail("no memory");
    }
    close(memory);
}

/* While nothing counts the ticks, an engine in reset is asked millions of times. */
static uint32_t read_dma(uint32_t offset) {
    static uint32_t answer;
    static int is_known;
    if (!is_known) {
        answer = engine_access(engine, offset, 0);
        is_known = strcmp(how, "frozen") == 0;
    }
    return answer;
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
        engine_access(engine, (uint32_t)(address - DMA_BASE) + 1, value);
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
    memcpy(real + place, cached.bytes + place, size);
}

void firm_cache_invalidate(const volatile void *memory, size_t size) {
    const size_t place = cached_place(memory, size);
    memcpy(cached.bytes + place, real + place, size);
}

uint64_t firm_bus_address(const volatile void *memory) {
    const uint64_t further = strcmp(how, "high") == 0 ? (uint64_t)1 << 32 : strcmp(how, "border") == 0 ? 0xEFFFFFC0u : 0;
    return BUS_BASE + further + cached_place(memory, 0) + (strcmp(how, "unaligned") == 0);
}

void firm_lock(firm_lock_t *lock) { (void)lock; }
void firm_unlock(firm_lock_t *lock) { (void)lock; }
uint32_t firm_milliseconds(void) { return now; }
void firm_pause(void) { now += strcmp(how, "frozen") != 0; }

/* --- what is played ------------------------------------------------------------------------------------------------- */

static uint8_t frame[LONGEST_STREAM], burst[LONGEST_STREAM];

static int play_dma(char **words) {
    static const char *const names[] = {"ok", "nothing", "burst", "too_long", "stuck", "no_sg", "error", "memory"};
    const int count = atoi(words[1]);
    const unsigned longest = (unsigned)atoi(words[2]);
    firm_dma_status_t status;
    firm_dma_t dma;
    int number;
    srand((unsigned)atoi(words[3]));
    how = words[4];
    open_board(words[0]);
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
            status = firm_dma_receive(&dma, burst, strcmp(how, "room") == 0 ? 50 : sizeof burst, &size);
        } while (status == FIRM_DMA_NOTHING && now++ < 100000);
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
