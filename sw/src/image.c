/* SPDX-License-Identifier: Apache-2.0 */
#include "image.h"

static void restart(struct image *image)
{
    image->at = image->begin;
    image->sum = 0;
    image->sums = 0;
}

void image_init(struct image *image, const volatile uint32_t *begin, const volatile uint32_t *end)
{
    image->begin = begin;
    image->end = end;
    restart(image);
}

bool image_step(struct image *image, uint32_t words)
{
    const volatile uint32_t *at = image->at;
    const volatile uint32_t *end = image->end;
    uint32_t sum = image->sum;
    uint32_t sums = image->sums;

    for (; words != 0 && at != end; words--) {
        sum += *at++;
        sums += sum;
    }
    image->at = at;
    image->sum = sum;
    image->sums = sums;
    if (at != end)
        return true;
    restart(image);
    return sum == end[0] && sums == end[1];
}
