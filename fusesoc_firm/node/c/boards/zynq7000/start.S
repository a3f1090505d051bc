/* SPDX-License-Identifier: Apache-2.0 */
/* The start of a program on the first Cortex-A9 of a Zynq-7000: exception vectors, stacks, floating point, memory,
 * then main. With FIRM_FREERTOS, the vectors are those of FreeRTOS's port ARM_CA9. */
    .syntax unified
    .arm

    .section .vectors, "ax"
    .global _start
_start:
    ldr pc, =reset
    ldr pc, =stop               /* undefined instruction */
#ifdef FIRM_FREERTOS
    ldr pc, =FreeRTOS_SWI_Handler
#else
    ldr pc, =stop
#endif
    ldr pc, =stop               /* fetch from illegal memory */
    ldr pc, =stop               /* access to illegal memory */
    ldr pc, =stop
#ifdef FIRM_FREERTOS
    ldr pc, =FreeRTOS_IRQ_Handler
#else
    ldr pc, =irq
#endif
    ldr pc, =stop
    .ltorg

    .text
stop:
    b stop

reset:
    cpsid if
    ldr r0, =_start
    mcr p15, 0, r0, c12, c0, 0  /* VBAR: the vectors are here, not at 0 */

    cps #0x12                   /* interrupts */
    ldr sp, =__irq_stack_end
    cps #0x1f                   /* system */
    ldr sp, =__stack_end
    cps #0x13                   /* supervisor, in which main runs */
    ldr sp, =__supervisor_stack_end

    mrc p15, 0, r0, c1, c0, 2   /* access to the floating-point unit */
    orr r0, r0, #(0xf << 20)
    mcr p15, 0, r0, c1, c0, 2
    isb
    mov r0, #(1 << 30)
    vmsr fpexc, r0

    ldr r0, =__bss_start
    ldr r1, =__bss_end
    mov r2, #0
1:  cmp r0, r1
    strlo r2, [r0], #4
    blo 1b

    bl firm_processor_map_memory
    bl main
    b stop

#ifndef FIRM_FREERTOS
irq:
    sub lr, lr, #4
    push {r0-r3, r12, lr}
    vpush {d0-d7}
    vpush {d16-d31}
    vmrs r0, fpscr
    push {r0, r1}               /* twice, since the stack is aligned to eight bytes */
    bl firm_board_answer_interrupt
    pop {r0, r1}
    vmsr fpscr, r0
    vpop {d16-d31}
    vpop {d0-d7}
    ldm sp!, {r0-r3, r12, pc}^
#endif
