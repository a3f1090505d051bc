/* A stand-in for FreeRTOS' header of this name, written for tests. Critical sections must not nest here, nor end before
 * they begin; a delay moves the clock, and is legal only while the scheduler runs. */
#ifndef STAND_IN_TASK_H
#define STAND_IN_TASK_H

#include <stdlib.h>

#include "FreeRTOS.h"

extern int stand_in_critical;
extern TickType_t stand_in_ticks;
extern int stand_in_scheduler;

#define taskENTER_CRITICAL() do { if (stand_in_critical++ != 0) abort(); } while (0)
#define taskEXIT_CRITICAL() do { if (--stand_in_critical != 0) abort(); } while (0)
#define xTaskGetTickCount() (stand_in_ticks)
#define taskSCHEDULER_RUNNING 2
#define xTaskGetSchedulerState() (stand_in_scheduler)
#define vTaskDelay(ticks)                                   \
    do {                                                    \
        if (stand_in_scheduler != taskSCHEDULER_RUNNING) abort(); \
        stand_in_ticks += (ticks);                          \
    } while (0)

#endif
