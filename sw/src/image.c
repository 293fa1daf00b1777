/* SPDX-License-Identifier: Apache-2.0 */
#include "image.h"

void image_begin(struct image *image, const volatile uint32_t *begin)
{
    image->at = begin;
    image->sum = 0;
    image->sums = 0;
}

bool image_step(struct image *image, const volatile uint32_t *begin, const volatile uint32_t *end, uint32_t words)
{
    const volatile uint32_t *at = image->at;
    uint32_t sum = image->sum;
    uint32_t sums = image->sums;

    for (; words != 0 && at != end; words--) { /* at most 64 turns: START_WORDS, IDLE_WORDS in the poll loop */
        sum += *at++;
        sums += sum;
    }
    image->at = at;
    image->sum = sum;
    image->sums = sums;
    if (at != end)
        return true;
    image_begin(image, begin);
    return sum == end[0] && sums == end[1];
}
