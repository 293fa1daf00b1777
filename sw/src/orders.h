/* SPDX-License-Identifier: Apache-2.0 */
/* What waits for the drive line, and the order of the telegram that is next (FRAME-7, SAFE-7). */
#ifndef ORDERS_H
#define ORDERS_H

#include "gateway.h"

/* Called once at each commit: keeps what the drive must be told. */
void orders_keep(struct gateway *g);

/* The telegram at the drive has left: if it is a parameter write, that waits no more. */
void orders_stop_waiting(struct gateway *g);

/* The drive refused the first telegram by type, and the second one is made: keeps it, if it may leave. */
void orders_again(struct gateway *g);

/* The master is lost, and the drive is to be told (SAFE-7). No start leaves then. The stop is ordered when no candidate
 * decides: with its commit the master is back. */
bool orders_stop_is_due(const struct gateway *g);

/* Something committed after the request at the drive waits for the drive line, too (FC-9). */
bool orders_wait(const struct gateway *g);

/* The drive line is free: orders the next telegram, if there is one. */
void orders_next(struct gateway *g);

/* Orders the telegram at the drive once more (FC-9). */
void orders_repeat(struct gateway *g);

/* The same after a commit that ended the repeat but asks the drive for nothing, so its licence is free for this. */
void orders_repeat_anew(struct gateway *g);

/* Takes an ordered telegram back. False if it left just then. */
bool orders_take_back(void);

#endif
