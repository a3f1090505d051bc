/* The registers of the model of AXI DMA (dma_engine.py), at its socket; for drivers in C and C++. */
#ifndef ENGINE_CLIENT_H
#define ENGINE_CLIENT_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>

static inline int engine_connect(const char *path) {
    struct sockaddr_un address;
    const int engine = socket(AF_UNIX, SOCK_STREAM, 0);
    memset(&address, 0, sizeof address);
    address.sun_family = AF_UNIX;
    strncpy(address.sun_path, path, sizeof address.sun_path - 1);
    if (connect(engine, (const struct sockaddr *)&address, sizeof address) != 0) {
        perror(path);
        exit(1);
    }
    return engine;
}

/* An offset plus 1 is a write. */
static inline uint32_t engine_access(int engine, uint32_t offset, uint32_t value) {
    const uint32_t words[2] = {offset, value};
    uint32_t answer = 0;
    if (send(engine, words, sizeof words, 0) != (ssize_t)sizeof words ||
        recv(engine, &answer, sizeof answer, MSG_WAITALL) != (ssize_t)sizeof answer) {
        perror("the engine");
        exit(1);
    }
    return answer;
}

#endif
