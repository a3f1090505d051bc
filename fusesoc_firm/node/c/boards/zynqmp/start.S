/* SPDX-License-Identifier: Apache-2.0 */
/* The start of a program on the first Cortex-A53 of a Zynq UltraScale+, in AArch64: exception vectors, stack, floating
 * point, memory, then main. The program stays at the exception level at which the boot code starts it: 3 after AMD's
 * FSBL, 1 or 2 after others. */

/* Registers of the three levels, chosen by the current one. */
    .macro at_level level3, level2, level1
    mrs x9, CurrentEL
    cmp x9, #(2 << 2)
    b.hi 3f
    b.eq 2f
    \level1
    b 4f
2:  \level2
    b 4f
3:  \level3
4:
    .endm

    .section .start, "ax"
    .global _start
_start:
    msr daifset, #15
    mrs x0, mpidr_el1
    tst x0, #0xff
    b.ne stop                   /* another processor */

    ldr x0, =__stack_end
    mov sp, x0
    ldr x0, =vectors
    at_level "msr vbar_el3, x0", "msr vbar_el2, x0", "msr vbar_el1, x0"

    /* Interrupts come to this level, and floating point is allowed. */
    mov x0, #(3 << 20)
    mov x1, #0x33ff
    mov x2, #(1 << 4)
    mov x3, xzr
    at_level "msr cptr_el3, x3", "msr cptr_el2, x1", "msr cpacr_el1, x0"
    at_level "bl route_to_3", "msr hcr_el2, x2", "nop"
    isb

    /* Gigabytes 0 and 1 are uncached RAM, so DMA transfers need no cache maintenance. The others are devices. */
    ldr x0, =table
    ldr x1, =0x4400             /* attribute 0 is device memory, 1 is memory that is not cached */
    ldr x2, =0x80803020         /* levels 2 and 3: 4 GiB, pages of 4 KiB, tables not cached */
    ldr x3, =0x00803020         /* level 1: the same, without a second table */
    at_level "msr mair_el3, x1", "msr mair_el2, x1", "msr mair_el1, x1"
    at_level "msr ttbr0_el3, x0", "msr ttbr0_el2, x0", "msr ttbr0_el1, x0"
    at_level "msr tcr_el3, x2", "msr tcr_el2, x2", "msr tcr_el1, x3"
    at_level "tlbi alle3", "tlbi alle2", "tlbi vmalle1"
    dsb sy
    isb
    at_level "mrs x0, sctlr_el3", "mrs x0, sctlr_el2", "mrs x0, sctlr_el1"
    orr x0, x0, #1              /* the tables are used */
    bic x0, x0, #2              /* accesses need not be aligned */
    bic x0, x0, #4              /* no data cache */
    at_level "msr sctlr_el3, x0", "msr sctlr_el2, x0", "msr sctlr_el1, x0"
    isb

    ldr x0, =__bss_start
    ldr x1, =__bss_end
1:  cmp x0, x1
    b.hs 2f
    str xzr, [x0], #8
    b 1b
2:  bl main

stop:
    wfi
    b stop

route_to_3:
    mrs x4, scr_el3
    orr x4, x4, #(1 << 1)
    msr scr_el3, x4
    ret

/* Entries of 1 GiB. */
    .balign 64
table:
    .quad 0x0000000000000705    /* not cached */
    .quad 0x0000000040000705
    .quad 0x0060000080000701    /* device, without instructions */
    .quad 0x00600000c0000701

/* Sixteen entries of 128 bytes; only interrupts at the program's own level are answered. */
    .macro entry target
    .balign 128
    b \target
    .endm

    .balign 2048
vectors:
    entry stop                  /* with the stack of level 0 */
    entry stop
    entry stop
    entry stop
    entry stop                  /* with the stack of this level */
    entry irq
    entry stop
    entry stop
    entry stop                  /* from a lower level */
    entry stop
    entry stop
    entry stop
    entry stop
    entry stop
    entry stop
    entry stop

/* A handler may change all registers that a function may change. */
irq:
    stp x0, x1, [sp, #-16]!
    stp x2, x3, [sp, #-16]!
    stp x4, x5, [sp, #-16]!
    stp x6, x7, [sp, #-16]!
    stp x8, x9, [sp, #-16]!
    stp x10, x11, [sp, #-16]!
    stp x12, x13, [sp, #-16]!
    stp x14, x15, [sp, #-16]!
    stp x16, x17, [sp, #-16]!
    stp x18, x30, [sp, #-16]!
    mrs x0, fpsr
    mrs x1, fpcr
    stp x0, x1, [sp, #-16]!
    .irp number, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
    str q\number, [sp, #-16]!
    .endr
    .irp number, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31
    str q\number, [sp, #-16]!
    .endr
    bl firm_board_answer_interrupt
    .irp number, 31, 30, 29, 28, 27, 26, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16
    ldr q\number, [sp], #16
    .endr
    .irp number, 15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0
    ldr q\number, [sp], #16
    .endr
    ldp x0, x1, [sp], #16
    msr fpsr, x0
    msr fpcr, x1
    ldp x18, x30, [sp], #16
    ldp x16, x17, [sp], #16
    ldp x14, x15, [sp], #16
    ldp x12, x13, [sp], #16
    ldp x10, x11, [sp], #16
    ldp x8, x9, [sp], #16
    ldp x6, x7, [sp], #16
    ldp x4, x5, [sp], #16
    ldp x2, x3, [sp], #16
    ldp x0, x1, [sp], #16
    eret
