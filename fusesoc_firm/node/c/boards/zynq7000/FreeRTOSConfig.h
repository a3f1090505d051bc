/* SPDX-License-Identifier: Apache-2.0 */
/* FreeRTOS's port ARM_CA9 on a Zynq-7000; its tick is that of firm_board.c. */
#ifndef FREERTOS_CONFIG_H
#define FREERTOS_CONFIG_H

#include "firm_board.h"

#define configUSE_PREEMPTION 1
#define configUSE_PORT_OPTIMISED_TASK_SELECTION 0
#define configTICK_RATE_HZ 1000
#define configTICK_TYPE_WIDTH_IN_BITS TICK_TYPE_WIDTH_32_BITS
#define configMAX_PRIORITIES 8
#define configMAX_TASK_NAME_LEN 16
#define configMINIMAL_STACK_SIZE 512
#define configTOTAL_HEAP_SIZE (256u * 1024u)
#define configSUPPORT_DYNAMIC_ALLOCATION 1
#define configUSE_MUTEXES 1
#define configUSE_IDLE_HOOK 0
#define configUSE_TICK_HOOK 0
#define configCHECK_FOR_STACK_OVERFLOW 0
/* Each task keeps its floating-point registers. */
#define configUSE_TASK_FPU_SUPPORT 2

#define INCLUDE_vTaskDelay 1
#define INCLUDE_xTaskGetSchedulerState 1

/* The interrupt controller: its distributor, and the distance from it to the processor's interface. */
#define configINTERRUPT_CONTROLLER_BASE_ADDRESS 0xF8F01000u
#define configINTERRUPT_CONTROLLER_CPU_INTERFACE_OFFSET (-0xF00)
#define configUNIQUE_INTERRUPT_PRIORITIES 32
#define configMAX_API_CALL_INTERRUPT_PRIORITY 18

#define configSETUP_TICK_INTERRUPT() firm_board_start_tick()
/* The timer's status. */
#define configCLEAR_TICK_INTERRUPT() (*(volatile uint32_t *)0xF8F0060Cu = 1u)

#define configASSERT(condition)                                   \
    do {                                                          \
        if (!(condition)) {                                       \
            firm_board_say("assertion of FreeRTOS: " __FILE__ "\n"); \
            for (;;) {                                            \
            }                                                     \
        }                                                         \
    } while (0)

#endif
