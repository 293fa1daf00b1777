/* SPDX-License-Identifier: Apache-2.0 */
#include "loopback.h"

#include "mailbox_port.h"
#include "ticks.h"

enum stage {
    STAGE_SETTLE,     /* waits until both lines have been silent */
    STAGE_TO_NETWORK, /* the drive port sends */
    STAGE_TO_DRIVE,   /* the network port sends */
    STAGE_SHOW_WAIT,  /* the result is known, the power-up show still runs */
    STAGE_RESULT,     /* the LEDs show the result */
};

enum { SETTLE = TICKS(10), TRANSFER = TICKS(40), RESULT = TICKS(12000) };

enum { ADR = 0x81, TELEGRAM_LENGTH = 14, RECEIVED_LENGTH = 16, FRAME_LENGTH = 14, GOOD_LGE = 0x0E };

/* As the network port receives it: STX, LGE, ADR, twelve data bytes, BCC. It commands nothing if a drive receives
 * it: AK is 0, and bit 10 of the control word is 0. */
static const uint8_t telegram[RECEIVED_LENGTH] = {0x02, 0x0E, ADR,  0x00, 0x00, 0x00, 0x00, 0x55,
                                                  0xAA, 0xFF, 0x01, 0x00, 0x00, 0x00, 0x00, 0x8C};

/* A frame that is also a telegram: its CRC is E2 64, and 64 is the BCC of the bytes before. */
static const uint8_t frame[FRAME_LENGTH] = {0x02, 0x0E, ADR,  0x55, 0xAA, 0x00, 0xFF,
                                            0x01, 0x80, 0x7F, 0xFE, 0x33, 0x00, 0x38};
enum { FRAME_CRC_LOW = 0xE2 };

/* The bank of the next request, where the hardware stores the telegram. */
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

    for (i = 0; i < bytes; i++)
        to[i].byte = from[i];
}

static bool same(frame_byte *received, const uint8_t *sent, uint32_t bytes)
{
    uint32_t i;

    for (i = 0; i < bytes; i++)
        if (received[i].byte != sent[i])
            return false;
    return true;
}

static void send_to_network(void)
{
    volatile struct frame_slot *bank = free_bank();
    uint32_t i;

    for (i = 0; i < RECEIVED_LENGTH; i++)
        bank[i].byte = 0x5A; /* the result of an earlier test must not count */
    fill(mailbox_frame(TELEGRAM_FRAME), telegram + 2, TELEGRAM_LENGTH);
    mailbox_write(TELEGRAM, TELEGRAM_LENGTH << MAILBOX__TELEGRAM__LENGTH_bp | MAILBOX__TELEGRAM__NO_REPLY_bm);
}

static void send_to_drive(void)
{
    mailbox_write(LISTEN, MAILBOX__LISTEN__ON_bm);
    fill(mailbox_frame(REPLY_FRAME), frame, FRAME_LENGTH);
    mailbox_write(REPLY, FRAME_LENGTH << MAILBOX__REPLY__LENGTH_bp);
}

static bool drive_received(void)
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

static void start_to_network(struct loopback *l, uint32_t now)
{
    send_to_network();
    enter(l, STAGE_TO_NETWORK, now);
}

static void start_to_drive(struct loopback *l, uint32_t now)
{
    l->passed = same(free_bank(), telegram, RECEIVED_LENGTH);
    send_to_drive();
    enter(l, STAGE_TO_DRIVE, now);
}

static void finish_transfers(struct loopback *l, uint32_t now)
{
    l->passed = l->passed && drive_received();
    mailbox_write(LISTEN, 0);
    enter(l, STAGE_SHOW_WAIT, now);
}

bool loopback_poll(struct loopback *l, uint32_t now, bool show_over)
{
    const uint32_t passed = now - l->stage_start;

    switch (l->stage) {
    case STAGE_SETTLE:
        if (passed > SETTLE)
            start_to_network(l, now);
        break;
    case STAGE_TO_NETWORK:
        if (passed > TRANSFER)
            start_to_drive(l, now);
        break;
    case STAGE_TO_DRIVE:
        if (passed > TRANSFER)
            finish_transfers(l, now);
        break;
    case STAGE_SHOW_WAIT:
        if (show_over)
            enter(l, STAGE_RESULT, now);
        break;
    default:
        if (passed >= RESULT) {
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
