/* SPDX-License-Identifier: Apache-2.0 */
/* From reset (address 0) to main. Nothing is copied: the memory is loaded with code and constants, and the
 * link fails if there is initialised data, so that a restart finds the same as the first start. */
    .section .start, "ax"
    .globl _start
_start:
    la sp, _stack_top
    la a0, _bss_start
    la a1, _bss_end
1:  bgeu a0, a1, 2f
    sw zero, 0(a0)
    addi a0, a0, 4
    j 1b
2:  call main
3:  j 3b

/* The one library function that the compiler calls by itself, for the assignment of structs. */
    .globl memcpy
    .type memcpy, @function
memcpy:
    mv t0, a0
1:  beqz a2, 2f
    lbu t1, 0(a1)
    sb t1, 0(t0)
    addi a1, a1, 1
    addi t0, t0, 1
    addi a2, a2, -1
    j 1b
2:  ret
