/* SPDX-License-Identifier: Apache-2.0 */
/* FreeRTOS: a lock is a critical section of the kernel, and a wait lets other tasks run. */
#include "firm_port.h"

#include "FreeRTOS.h"
#include "task.h"

void firm_lock(firm_lock_t *lock) {
    (void)lock;
    taskENTER_CRITICAL();
}

void firm_unlock(firm_lock_t *lock) {
    (void)lock;
    taskEXIT_CRITICAL();
}

uint32_t firm_milliseconds(void) { return (uint32_t)xTaskGetTickCount() * (uint32_t)portTICK_PERIOD_MS; }

/* Wait at least one tick, so that tasks of lower priority also run. Before the scheduler runs, nothing may wait. The
 * kernel's configuration needs INCLUDE_vTaskDelay and INCLUDE_xTaskGetSchedulerState. */
void firm_pause(void) {
    if (xTaskGetSchedulerState() == taskSCHEDULER_RUNNING) {
        vTaskDelay(1);
    }
}
