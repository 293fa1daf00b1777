/* SPDX-License-Identifier: Apache-2.0 */
/* The instrumented copies of the sources call loop_step in every round of every loop (sw/test/loops.py). */
#ifndef LOOPS_H
#define LOOPS_H

struct loop {
    const char *where;
    unsigned long most; /* rounds */
    unsigned long seen;
};

/* Aborts the run when a loop exceeds its bound. */
void loop_step(unsigned number, unsigned long rounds);

#endif
