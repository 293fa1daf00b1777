/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The firmware's own image, checked at start and over and over while there is nothing else to do (LED-5).
 *
 * Two words behind the image hold the sum of its words and the sum of all intermediate sums, both modulo
 * 2^32 (sw/tools/seal.py writes them). Any single damaged word changes the first, two that swapped places
 * or cancel each other out change the second.
 */
#ifndef IMAGE_H
#define IMAGE_H

#include <stdbool.h>
#include <stdint.h>

struct image {
    const volatile uint32_t *begin;
    const volatile uint32_t *end; /* here stand the two sums */
    const volatile uint32_t *at;
    uint32_t sum;
    uint32_t sums;
};

void image_init(struct image *image, const volatile uint32_t *begin, const volatile uint32_t *end);

/* Adds up to `words` more words; false if a round is complete and does not add up. */
bool image_step(struct image *image, uint32_t words);

#endif
