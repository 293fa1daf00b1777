/* SPDX-License-Identifier: Apache-2.0 */
/* From reset (address 0) to main: sets gp and sp, and clears the variables. Code and constants are loaded with the
 * memory. The link fails if there is initialised data, so a restart equals the first start. */
    .section .start, "ax"
    .globl _start
_start:
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
