/* SPDX-License-Identifier: Apache-2.0 */
/* What the counting copies of the sources call in every round of every loop (sw/test/loops.py). */
#ifndef LOOPS_H
#define LOOPS_H

struct loop {
    const char *where;
    unsigned long most; /* rounds */
    unsigned long seen;
};

/* Ends the run when the loop goes round more often than stated. */
void loop_step(unsigned number, unsigned long rounds);

#endif
