/* SPDX-License-Identifier: Apache-2.0 */
/* Counts loop rounds. LOOPS_SEEN=file in the environment writes the most rounds and the bound of each loop at exit. */
#include "loops.h"

#include <stdio.h>
#include <stdlib.h>

#include "loop_table.h"

static void write_seen(void)
{
    FILE *file = fopen(getenv("LOOPS_SEEN"), "w");
    unsigned i;

    if (!file)
        return;
    for (i = 0; i < sizeof loops / sizeof *loops; i++)
        (void)fprintf(file, "%lu\t%lu\t%s\n", loops[i].seen, loops[i].most, loops[i].where);
    (void)fclose(file);
}

void loop_step(unsigned number, unsigned long rounds)
{
    static int begun;
    struct loop *loop = &loops[number];

    if (!begun && getenv("LOOPS_SEEN"))
        (void)atexit(write_seen);
    begun = 1;
    if (rounds <= loop->seen)
        return;
    loop->seen = rounds;
    if (rounds > loop->most) {
        (void)fprintf(stderr, "more than %lu rounds of %s\n", loop->most, loop->where);
        abort();
    }
}
