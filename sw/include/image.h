/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Check of the firmware image, at start and repeatedly while the firmware is idle (docs/hardening.md, Firmware image
 * check; LED-5).
 *
 * Two words after the image hold the sum of its words and the sum of all intermediate sums, both modulo 2^32
 * (sw/tools/seal.py writes them). A single damaged word changes the first sum. Two words that swapped places, or whose
 * damage cancels in the first sum, change the second.
 */
#ifndef IMAGE_H
#define IMAGE_H

#include <stdbool.h>
#include <stdint.h>

struct image {
    const volatile uint32_t *at;
    uint32_t sum;
    uint32_t sums;
};

void image_begin(struct image *image, const volatile uint32_t *begin);

/* Adds up to `words` more words of the image, whose two sums are at `end`. False if a pass is complete and a sum
 * differs. */
bool image_step(struct image *image, const volatile uint32_t *begin, const volatile uint32_t *end, uint32_t words);

#endif
