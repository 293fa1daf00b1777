/* SPDX-License-Identifier: Apache-2.0 */
/* The exchange with the drive: a telegram that leaves, the reply, the repeat and the end (FC-8, FC-9). */
#ifndef EXCHANGE_H
#define EXCHANGE_H

#include "gateway.h"

/* Follows the exchange one step, and begins the next one if the drive line is free. */
void exchange_poll(struct gateway *g);

#endif
