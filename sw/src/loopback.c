/* SPDX-License-Identifier: Apache-2.0 */
#include "loopback.h"

#include "mailbox_port.h"
#include "ticks.h"

enum stage {
    STAGE_OVER,       /* no test, or its result was shown */
    STAGE_LISTEN,     /* for somebody else's characters */
    STAGE_TO_NETWORK, /* the drive port sends */
    STAGE_TO_DRIVE,   /* the network port sends */
    STAGE_RESULT,     /* the LEDs show the result */
};

enum { LISTEN = TICKS(1000), TRANSFER = TICKS(40), RESULT = TICKS(12000) };

/* The drive port sends the 16 bytes, with LENGTH as LGE. The last one is a wrong BCC, and no CRC fits: neither a drive
 * nor a slave accepts the pattern. The network port sends them with a larger LGE, LONGER, and a wrong CRC
 * (rtl/network_port.v): for a drive the telegram never ends. FILLER, before and after, shows what was received. */
enum { AT_LGE = 1, AT_ADR = 2, AT_DATA = 3, PATTERN = 16, CRC = 2, LENGTH = PATTERN - AT_ADR, LONGER = 30 };
enum { FILLER = 0x5A };

/* After the pattern: the inverted CRC of the longer one, as the network port sends it. Then FILLER, the byte that the
 * drive port must not overwrite. */
static const uint8_t pattern[PATTERN + CRC + 1] = {0x02, LENGTH, 0x81, 0x00, 0x00, 0x00, 0x00, 0x55, 0xAA,  0xFF,
                                                   0x01, 0x00,   0x00, 0x00, 0x00, 0x73, 0x27, 0xB7, FILLER};

/* The bank of the next request, where the hardware stores the pattern. */
static volatile struct frame_slot *free_bank(void)
{
    return mailbox_read(REQUEST) & MAILBOX__REQUEST__BANK_bm ? mailbox_frame(REQUEST_FRAME_0)
                                                             : mailbox_frame(REQUEST_FRAME_1);
}

static void enter(struct loopback *l, enum stage stage, uint32_t now)
{
    l->stage = (uint8_t)stage;
    l->stage_start = now;
}

static void fill(volatile struct frame_slot *to, const uint8_t *from, uint32_t bytes)
{
    uint32_t i;

    for (i = 0; i < bytes; i++) /* at most 16 turns: PATTERN */
        to[i].byte = from[i];
}

static bool same(frame_byte *received, const uint8_t *sent)
{
    uint32_t i;

    for (i = 0; i < PATTERN; i++) /* at most 16 turns: PATTERN */
        if (received[i].byte != sent[i])
            return false;
    return true;
}

static void send_to_network(void)
{
    volatile struct frame_slot *bank = free_bank();
    uint32_t i;

    for (i = 0; i <= PATTERN; i++) /* at most 17 turns: PATTERN and one */
        bank[i].byte = mailbox_frame(DRIVE_FRAME)[i].byte = FILLER;
    fill(mailbox_frame(TELEGRAM_FRAME), pattern + AT_ADR, LENGTH);
    mailbox_write(TELEGRAM, LENGTH << MAILBOX__TELEGRAM__LENGTH_bp | MAILBOX__TELEGRAM__NO_REPLY_bm);
}

static bool network_received(void)
{
    frame_byte *bank = free_bank();

    return same(bank, pattern) && bank[PATTERN].byte == FILLER;
}

static void send_to_drive(void)
{
    mailbox_write(LISTEN, MAILBOX__LISTEN__ON_bm);
    fill(mailbox_frame(REPLY_FRAME), pattern, PATTERN);
    mailbox_frame(REPLY_FRAME)[AT_LGE].byte = LONGER;
    mailbox_write(REPLY, PATTERN << MAILBOX__REPLY__LENGTH_bp);
}

/* The receiver stored the data only if STX and ADR were right (rtl/fc_rx.v). */
static bool drive_received(void)
{
    return mailbox_frame(DRIVE_LGE)->byte == LONGER && same(mailbox_frame(DRIVE_FRAME), pattern + AT_DATA);
}

static void close(void)
{
    mailbox_write(SUPERVISOR, MAILBOX__SUPERVISOR__LOOPBACK_bm);
}

/* A card that was set to the test by mistake works at once. */
static void finish(struct loopback *l, bool passed, uint32_t now)
{
    l->passed = passed;
    mailbox_write(LISTEN, 0);
    if (!passed)
        close();
    enter(l, STAGE_RESULT, now);
}

void loopback_init(struct loopback *l, uint32_t now)
{
    if (mailbox_read(EXCHANGE) & MAILBOX__EXCHANGE__LOOPBACK_bm)
        enter(l, STAGE_LISTEN, now);
    else
        close(); /* until the next reset (docs/hardening.md, Loop-back test locked) */
}

static void show_result(struct loopback *l, uint32_t now, bool show_over)
{
    if (!show_over)
        l->stage_start = now;
    if (now - l->stage_start < RESULT)
        return;
    close();
    l->stage = STAGE_OVER;
}

static void advance(struct loopback *l, uint32_t now, uint32_t passed)
{
    if (l->stage == STAGE_LISTEN) {
        if (passed > LISTEN) {
            send_to_network();
            enter(l, STAGE_TO_NETWORK, now);
        }
    } else if (passed <= TRANSFER) {
        /* the pattern is on the line */
    } else if (l->stage == STAGE_TO_DRIVE) {
        finish(l, drive_received(), now);
    } else if (network_received()) {
        send_to_drive();
        enter(l, STAGE_TO_DRIVE, now);
    } else {
        finish(l, false, now);
    }
}

bool loopback_poll(struct loopback *l, uint32_t now, const struct leds *leds)
{
    uint32_t state;

    if (l->stage == STAGE_OVER)
        return false;
    state = mailbox_read(EXCHANGE);
    if (state & MAILBOX__EXCHANGE__LOOPBACK_bm && state & MAILBOX__EXCHANGE__HEARD_bm)
        finish(l, false, now);
    else if (l->stage == STAGE_RESULT)
        show_result(l, now, leds_show_is_over(leds));
    else
        advance(l, now, now - l->stage_start);
    return (mailbox_read(EXCHANGE) & MAILBOX__EXCHANGE__LOOPBACK_bm) != 0;
}

uint32_t loopback_leds(const struct loopback *l)
{
    const uint32_t red = MAILBOX__LED__MODBUS_RED_bm | MAILBOX__LED__DRIVE_RED_bm;
    const uint32_t green = MAILBOX__LED__MODBUS_GREEN_bm | MAILBOX__LED__DRIVE_GREEN_bm;

    if (l->stage != STAGE_RESULT)
        return 0;
    return l->passed ? red | green : red;
}
