/* SPDX-License-Identifier: Apache-2.0 */
#include "gateway.h"
#include "image.h"
#include "mailbox_port.h"

/* Words of the image in one idle round of the loop: a candidate waits for no more than that. */
enum { IDLE_WORDS = 4 };

/* From the linker: the image, and the sums behind it. */
extern const uint32_t _start[], _image_end[];

static void check(struct image *image, uint32_t words)
{
    if (!image_step(image, words))
        mailbox_write(SUPERVISOR, MAILBOX__SUPERVISOR__HALT_bm);
}

int main(void)
{
    static struct gateway gateway;
    static struct image image;

    image_init(&image, _start, _image_end);
    check(&image, UINT32_MAX);
    gateway_init(&gateway);
    for (;;) {
        gateway_poll(&gateway);
        mailbox_write(WATCHDOG, MAILBOX__WATCHDOG__KEY_reset);
        if (gateway_is_idle(&gateway))
            check(&image, IDLE_WORDS);
    }
}
