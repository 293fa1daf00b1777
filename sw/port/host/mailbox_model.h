/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The mailbox as the firmware sees it: registers, commit gate and both lines, one event at a time. The one model for
 * the fuzzer (sw/test/fuzz_gateway.c) and for the Python tests (tb/model/fake_mailbox.py).
 *
 * The rules are those of rtl/gate/, rtl/mailbox_regs.v and rtl/fc_rx.v, without simultaneous events. A line transfers
 * a frame in no time, except a telegram of ours, which mailbox_telegram_ends ends. What leaves is bit for bit what the
 * firmware queued: bits 6 and 10 of a control word are not cleared, so a check sees an error of the firmware. The
 * model judges nothing. Judges look at the state between two events; at most one reply and one telegram leave in one.
 * Frames are in the frame memory (host_frames), from unit address or ADR on. Bytes that the hardware did not write
 * read as MAILBOX_JUNK.
 */
#ifndef MAILBOX_MODEL_H
#define MAILBOX_MODEL_H

#include <stdbool.h>
#include <stdint.h>

enum { MAILBOX_JUNK = 0xA5, MAILBOX_FRAME_MAX = 32 };

/* What a telegram needs a licence for (rtl/gate/licences.v). */
enum mailbox_kind { KIND_NEWEST, KIND_IMAGE, KIND_ONE, KIND_ALL, MAILBOX_KINDS };

/* With SECOND_TELEGRAM a parameter write for this card gives two. */
enum { TELEGRAMS_OF_A_WRITE = 2 };

/* State of one number each, most of them 0 or 1. mailbox_fields names them for Python. */
#define MAILBOX_STATE(field) \
    /* time in 1/1200 s; quiet: the pause before a telegram is over (FC-8), and nobody else sends */ \
    /* heard: somebody else's character since power-up (LOOP-1) */ \
    /* outside: shown by each register that a source outside the mailbox feeds and the model does not know */ \
    field(ticks) field(quiet) field(heard) field(loopback) field(outside) \
    /* registers that the firmware writes; kicks of the watchdog; accesses that the model does not serve; broken rules */ \
    field(events) field(led) field(halted) field(kicks) field(restarts) field(unknown) field(broken) \
    /* the newest request; request: the number that the judge gave it */ \
    field(address) field(ticket) field(bank) field(length) field(request) field(is_broadcast) field(writes_coils) \
    field(writes_parameter) field(is_candidate) field(is_committed) field(answerable) field(answered) \
    /* the reply; how many have left */ \
    field(reply_queued) field(wait_drive) field(reply_length) field(sent_replies) \
    /* the telegram, and the number of the request that gave its licence; how many have left */ \
    field(telegram_queued) field(licensed) field(started) field(sending) field(no_reply) field(telegram_length) \
    field(asker) field(sent_telegrams) \
    /* its kind (enum mailbox_kind); left: it has left; again: its repeat is ordered or has left; is_stop: ordered as the stop */ \
    field(kind) field(left) field(repeatable) field(again) field(is_stop) field(without_start) \
    /* the drive's telegram */ \
    field(listening) field(drive_candidate) field(drive_good) \
    /* the stop (SAFE-7): limit and the time of the last commit in ticks */ \
    field(armed) field(limit) field(since)

#define MAILBOX_MEMBER(name) uint32_t name;
struct mailbox {
    MAILBOX_STATE(MAILBOX_MEMBER)
    /* By enum mailbox_kind: how many telegrams the last commit of the kind still allows; the number of its request. */
    uint32_t valid[MAILBOX_KINDS];
    uint32_t given_by[MAILBOX_KINDS];
    uint32_t free; /* the image's licence is of a write of coils, so its start bit may be 1 */
    uint8_t telegram[MAILBOX_FRAME_MAX]; /* as it was when it was queued */
};

/* Bits of `broken`: orders that no correct firmware gives, and a write to the telegram on the line. */
enum {
    BROKEN_OVERWRITTEN = 1, /* a telegram is ordered while another one is on the line */
    BROKEN_BCC = 2,         /* BCC or length are wrong; the loop-back test's pattern has a wrong BCC (LOOP-1) */
    BROKEN_STOP = 4,        /* a stop that starts the drive (SAFE-7) */
    BROKEN_TOUCHED = 8,     /* the telegram changed while it was sent */
};

extern const char mailbox_fields[]; /* the names of MAILBOX_STATE, with spaces between */
extern const uint32_t mailbox_size; /* of struct mailbox, in bytes */

void mailbox_init(struct mailbox *m);    /* power-up; the frame memory is 0 */
void mailbox_restart(struct mailbox *m); /* the watchdog restarts the firmware (WDG-1) */

/* Register accesses of the firmware. */
uint32_t mailbox_on_read(struct mailbox *m, uint32_t offset);
void mailbox_on_write(struct mailbox *m, uint32_t offset, uint32_t value);

/* The network line: a good frame and half a character, t3.5, a character of somebody. number is not 0. */
void mailbox_candidate(struct mailbox *m, uint32_t number, const uint8_t *pdu, uint32_t length, uint32_t broadcast);
void mailbox_commit(struct mailbox *m);
void mailbox_character(struct mailbox *m);

/* The drive line: the pause is over, our telegram is out, a telegram without STX, LGE, ADR and BCC, its BCC. */
void mailbox_pause_over(struct mailbox *m);
void mailbox_telegram_ends(struct mailbox *m);
void mailbox_drive_data(struct mailbox *m, const uint8_t *data, uint32_t length, uint32_t lge);
void mailbox_bcc(struct mailbox *m, uint32_t good);

/* Called with each telegram and reply that leaves; the user of the model defines it. */
void mailbox_left(const struct mailbox *m, bool telegram);

/* 1 if the telegram in the frame memory differs from the one queued last. */
uint32_t mailbox_is_touched(const struct mailbox *m);

/* A field of the value that is written to a register. */
#define MAILBOX_FIELD(reg, field, value) \
    (((value) & MAILBOX__##reg##__##field##_bm) >> MAILBOX__##reg##__##field##_bp)

/* The slot that stores byte i of a telegram's data: of a long text the last four bytes remain (FC-7). */
static inline uint32_t mailbox_drive_slot(uint32_t i)
{
    return i < 24 ? i : 24 + (i & 3u);
}

#endif
