/* SPDX-License-Identifier: Apache-2.0 */
/* Start and poll loop: image check, watchdog kicks, gateway (LED-5, WDG-1). */
#include "gateway.h"
#include "image.h"
#include "mailbox_port.h"
#include "options.h"

/* Words of the image checked between two kicks of the watchdog. IDLE_WORDS is small because a candidate may arrive
 * meanwhile and wait; at the start no request is served. */
enum { IDLE_WORDS = 1, START_WORDS = 64 };

/* Set by the linker: the image, and the two sums after it. */
extern const uint32_t _start[], _image_end[];

static void check(struct image *image, uint32_t words)
{
    if (!image_step(image, _start, _image_end, words))
        mailbox_write(SUPERVISOR, MAILBOX__SUPERVISOR__HALT_bm);
}

static void kick(void)
{
    uint32_t word = MAILBOX__WATCHDOG__KEY_reset;

    if (STRICT_T15)
        word |= MAILBOX__WATCHDOG__STRICT_T15_bm;
    if (BREAK_TOLERANT)
        word |= MAILBOX__WATCHDOG__BREAK_TOLERANT_bm;
    mailbox_write(WATCHDOG, word);
}

int main(void)
{
    static struct gateway gateway;
    static struct image image;
    struct gateway *g = &gateway;

    image_begin(&image, _start);
    do { /* at most 24 turns: the words of the smallest memory, START_WORDS in each turn */
        kick();
        check(&image, START_WORDS);
    } while (image.at != _start);
    gateway_init(g);
    for (;;) { /* endless: the poll loop, under the watchdog */
        kick();
        if (gateway_poll(g))
            check(&image, IDLE_WORDS);
    }
}
