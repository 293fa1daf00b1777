/* SPDX-License-Identifier: Apache-2.0 */
/* From reset (address 0) to main: loads every register, so that two cores in lockstep agree whatever their registers
 * held (SAFE-4, SAFE-5), sets gp and sp, and clears the variables. Code and constants are loaded with the
 * memory. The link fails if there is initialised data, so a restart equals the first start. */
    .section .start, "ax"
    .globl _start
_start:
#if LOCKSTEP
    .irp register, ra, tp, t0, t1, t2, s0, s1, a2, a3, a4, a5, a6, a7, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11, t3, t4, t5, t6
    li \register, 0
    .endr
#endif
    .option push
    .option norelax
    la gp, __global_pointer$
    la sp, _stack_top /* may be too far from gp */
    .option pop
    la a0, _bss_start
    la a1, _bss_end
1:  bgeu a0, a1, 2f
    sw zero, 0(a0)
    addi a0, a0, 4
    j 1b
2:  call main
3:  j 3b
