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
    bool good;

    for (; words != 0 && image->at != image->end; words--) {
        image->sum += *image->at++;
        image->sums += image->sum;
    }
    if (image->at != image->end)
        return true;
    good = image->sum == image->end[0] && image->sums == image->end[1];
    restart(image);
    return good;
}
