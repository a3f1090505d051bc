/* A stand-in for FreeRTOS' header of this name, written for tests: what ports/freertos uses of it, and no more. */
#ifndef STAND_IN_FREERTOS_H
#define STAND_IN_FREERTOS_H

#include <stdint.h>

typedef uint32_t TickType_t;
#define portTICK_PERIOD_MS ((TickType_t)10)

#endif
