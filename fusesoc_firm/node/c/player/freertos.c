/* SPDX-License-Identifier: Apache-2.0 */
/* With FreeRTOS: a task puts messages, and another one carries frames. */
#include "FreeRTOS.h"
#include "firm_board.h"
#include "firm_player.h"
#include "task.h"

#define STACK_WORDS 4096

static void put(void *unused) {
    (void)unused;
    for (;;) {
        if (!firm_player_put()) {
            vTaskDelay(1);
        }
    }
}

static void carry(void *unused) {
    (void)unused;
    for (;;) {
        if (!firm_player_carry()) {
            vTaskDelay(1);
        }
    }
}

int main(void) {
    firm_board_start();
    firm_player_open();
    (void)xTaskCreate(put, "put", STACK_WORDS, NULL, 2, NULL);
    (void)xTaskCreate(carry, "carry", STACK_WORDS, NULL, 2, NULL);
    vTaskStartScheduler();
    firm_board_say("FreeRTOS has no memory for its tasks\n");
    return 1;
}
