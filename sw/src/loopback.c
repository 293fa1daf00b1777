/* SPDX-License-Identifier: Apache-2.0 */
#include "loopback.h"

#include "mailbox_port.h"
#include "ticks.h"

enum stage {
    STAGE_SETTLE,    /* both lines must have been silent before anything may leave */
    STAGE_TO_NETWORK, /* the drive port sends */
    STAGE_TO_DRIVE,  /* the network port sends */
    STAGE_SHOW_WAIT, /* the verdict stands, the power-up show still runs */
    STAGE_VERDICT,
};

enum { SETTLE = TICKS(10), TRANSFER = TICKS(40), VERDICT = TICKS(12000) };

enum { ADR = 0x81, TELEGRAM_LENGTH = 14, HEARD_LENGTH = 16, FRAME_LENGTH = 14, GOOD_LGE = 0x0E };

/* As heard by the network port: STX, LGE, ADR, twelve data bytes, BCC. Should a drive listen after all: no
 * command to a parameter (AK 0), and bit 10 of the control word is 0. */
static const uint8_t telegram[HEARD_LENGTH] = {0x02, 0x0E, ADR,  0x00, 0x00, 0x00, 0x00, 0x55,
                                               0xAA, 0xFF, 0x01, 0x00, 0x00, 0x00, 0x00, 0x8C};

/* A frame that is a telegram too: its CRC comes out as E2 64, and 64 is the BCC of the rest. */
static const uint8_t frame[FRAME_LENGTH] = {0x02, 0x0E, ADR,  0x55, 0xAA, 0x00, 0xFF,
                                            0x01, 0x80, 0x7F, 0xFE, 0x33, 0x00, 0x38};
enum { FRAME_CRC_LOW = 0xE2 };

static volatile struct frame_slot *free_bank(void)
{
    return mailbox_read(REQUEST) & MAILBOX__REQUEST__BANK_bm ? mailbox_frame(REQUEST_FRAME_0)
                                                             : mailbox_frame(REQUEST_FRAME_1);
}

static void enter(struct loopback *l, enum stage stage, uint32_t now)
{
    l->stage = (uint8_t)stage;
    l->since = now;
}

static void fill(volatile struct frame_slot *to, const uint8_t *from, uint32_t bytes)
{
    uint32_t i;

    for (i = 0; i < bytes; i++)
        to[i].byte = from[i];
}

static bool same(frame_byte *heard, const uint8_t *sent, uint32_t bytes)
{
    uint32_t i;

    for (i = 0; i < bytes; i++)
        if (heard[i].byte != sent[i])
            return false;
    return true;
}

static void send_to_network(void)
{
    volatile struct frame_slot *bank = free_bank();
    uint32_t i;

    for (i = 0; i < HEARD_LENGTH; i++)
        bank[i].byte = 0x5A; /* nothing of an earlier test may pass for this one's */
    fill(mailbox_frame(TELEGRAM_FRAME), telegram + 2, TELEGRAM_LENGTH);
    mailbox_write(TELEGRAM, TELEGRAM_LENGTH << MAILBOX__TELEGRAM__LENGTH_bp | MAILBOX__TELEGRAM__NO_REPLY_bm);
}

static void send_to_drive(void)
{
    mailbox_write(LISTEN, MAILBOX__LISTEN__ON_bm);
    fill(mailbox_frame(REPLY_FRAME), frame, FRAME_LENGTH);
    mailbox_write(REPLY, FRAME_LENGTH << MAILBOX__REPLY__LENGTH_bp);
}

static bool drive_heard(void)
{
    frame_byte *data = mailbox_frame(DRIVE_FRAME);

    return mailbox_read(EXCHANGE) & MAILBOX__EXCHANGE__GOOD_bm &&
           mailbox_frame(DRIVE_LGE)->byte == GOOD_LGE && same(data, frame + 3, FRAME_LENGTH - 3) &&
           data[FRAME_LENGTH - 3].byte == FRAME_CRC_LOW;
}

bool loopback_init(struct loopback *l, uint32_t now)
{
    l->passed = false;
    enter(l, STAGE_SETTLE, now);
    return (mailbox_read(EXCHANGE) & MAILBOX__EXCHANGE__LOOPBACK_bm) != 0;
}

bool loopback_poll(struct loopback *l, uint32_t now, bool show_over)
{
    const uint32_t passed = now - l->since;

    switch (l->stage) {
    case STAGE_SETTLE:
        if (passed > SETTLE) {
            send_to_network();
            enter(l, STAGE_TO_NETWORK, now);
        }
        break;
    case STAGE_TO_NETWORK:
        if (passed > TRANSFER) {
            l->passed = same(free_bank(), telegram, HEARD_LENGTH);
            send_to_drive();
            enter(l, STAGE_TO_DRIVE, now);
        }
        break;
    case STAGE_TO_DRIVE:
        if (passed > TRANSFER) {
            l->passed = l->passed && drive_heard();
            mailbox_write(LISTEN, 0);
            enter(l, STAGE_SHOW_WAIT, now);
        }
        break;
    case STAGE_SHOW_WAIT:
        if (show_over)
            enter(l, STAGE_VERDICT, now);
        break;
    default:
        if (passed >= VERDICT) {
            mailbox_write(SUPERVISOR, MAILBOX__SUPERVISOR__LOOPBACK_bm);
            return false;
        }
        break;
    }
    return true;
}

uint32_t loopback_leds(const struct loopback *l)
{
    const uint32_t red = MAILBOX__LED__MODBUS_RED_bm | MAILBOX__LED__DRIVE_RED_bm;
    const uint32_t green = MAILBOX__LED__MODBUS_GREEN_bm | MAILBOX__LED__DRIVE_GREEN_bm;

    return l->passed ? red | green : red;
}
