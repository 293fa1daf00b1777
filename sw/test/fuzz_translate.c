/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fuzzes the translation core with requests and drive replies in any order, committed or not.
 *
 * Checked: only a commit changes the settings. A telegram carries the coils or accesses a parameter; only a write
 * request writes one. Bit 10 of the control word comes from the coils alone. A reply fits its request. A broadcast
 * is never answered. Coils read as written.
 */
#include <stdlib.h>
#include <string.h>

#include "codes.h"
#include "fuzz.h"
#include "host.h"
#include "mailbox_model.h"
#include "translate.h"

enum { STEPS = 200, BANK = PDU_KEPT, DRIVE_BANK = 28 };

struct slot {
    struct transaction *txn;
    uint8_t pdu[PDU_MAX];
    uint8_t telegram[TELEGRAM_MAX]; /* the last one; in the card's dialect the reply takes its place */
    bool at_drive;
    bool again; /* the second telegram has been made */
};

struct bench {
    struct translator t;
    struct model model;
    struct slot slots[2];
    struct frame_slot *bank;
    struct frame_slot *drive_bank;
};

static bool same_settings(const struct settings *a, const struct settings *b)
{
    return !memcmp(a->word, b->word, sizeof a->word);
}

/* status: coils 33-64. */
static void check_coils(const struct bench *b, const uint8_t *pdu, const struct transaction *txn, uint32_t status)
{
    const uint32_t first = (uint32_t)pdu[1] << 8 | pdu[2];
    const uint32_t quantity = (uint32_t)pdu[3] << 8 | pdu[4];
    uint32_t i;

    HOLDS(first + quantity <= 128);
    HOLDS(txn->out.reply[1] == (quantity + 7) / 8);
    for (i = 0; i < 8u * txn->out.reply[1]; i++) {
        const bool of_drive = first + i >= 32 && first + i < 64;
        const bool is = i < quantity && (of_drive ? status >> (first + i - 32) & 1 : b->model.coils[first + i]);

        HOLDS((txn->out.reply[2 + i / 8] >> i % 8 & 1) == is);
    }
}

static void check_reply(const struct bench *b, const struct slot *slot, uint32_t status)
{
    const struct transaction *txn = slot->txn;

    HOLDS(!txn->broadcast);
    HOLDS(txn->reply_length >= 2 && txn->reply_length <= REPLY_PDU_MAX);
    if (txn->out.reply[0] & 0x80) {
        HOLDS(txn->out.reply[0] == (slot->pdu[0] | 0x80));
        HOLDS(txn->reply_length == 2);
        return;
    }
    HOLDS(txn->out.reply[0] == slot->pdu[0]);
    if (diagnoses(txn->out.reply[0]))
        return;
    if (txn->out.reply[0] == READ_COILS || txn->out.reply[0] == READ_REGISTERS) {
        HOLDS(txn->reply_length == 2 + txn->out.reply[1]);
        if (txn->out.reply[0] == READ_COILS)
            check_coils(b, slot->pdu, txn, status);
        else
            HOLDS(txn->out.reply[1] == 2u * slot->pdu[4]);
    } else {
        HOLDS(txn->reply_length == 5);
        HOLDS(!memcmp(txn->out.reply, slot->pdu, 5));
    }
}

static void check_parameter_telegram(const struct slot *slot, const struct model *after, enum intent intent)
{
    const struct transaction *txn = slot->txn;
    const uint8_t *data = txn->out.telegram + 1;
    const uint32_t length = txn->telegram_length - 2u;
    const uint32_t pcd = (uint32_t)data[length - 4] << 8 | data[length - 3];
    const uint32_t pnu = ((uint32_t)data[0] << 8 | data[1]) & 0x0FFF;

    HOLDS(length >= 10 && !(length & 1));
    HOLDS(intent == INTENT_READ || intent == INTENT_WRITE);
    HOLDS(pcd == 0 && data[length - 2] == 0 && data[length - 1] == 0);
    HOLDS(pnu >= 1 && pnu <= TRAITS.pnu_max);
    HOLDS(10 * pnu - 1 == ((uint32_t)slot->pdu[1] << 8 | slot->pdu[2]));
    HOLDS(data[3] == (after->ind & 0xFF));
    switch (data[0] >> 4) {
    case AK_READ:
        HOLDS(intent == INTENT_READ && data[2] == 0);
        break;
    case AK_WRITE_WORD:
    case AK_WRITE_DOUBLE:
        HOLDS(intent == INTENT_WRITE && data[2] == 0 && !after->coils[64]);
        break;
    case AK_STORE - AK_WRITE_WORD:
    case AK_STORE - AK_WRITE_DOUBLE:
        HOLDS(intent == INTENT_WRITE && data[2] == 0 && after->coils[64]);
        break;
    case AK_TEXT:
        HOLDS(data[2] == (intent == INTENT_READ ? 4 : 5));
        HOLDS(intent == INTENT_WRITE || length == 12);
        break;
    default:
        NEVER("an AK that the card sends");
    }
}

static void check_telegram(const struct slot *slot, const struct model *after, enum intent intent)
{
    const struct transaction *txn = slot->txn;
    const uint8_t *data = txn->out.telegram + 1;
    const uint32_t length = txn->telegram_length - 2u;
    const uint32_t pcd = (uint32_t)data[length - 4] << 8 | data[length - 3];

    HOLDS(txn->telegram_length <= TELEGRAM_MAX);
    HOLDS(bcc_fits(txn->out.telegram, txn->telegram_length));
    HOLDS(txn->out.telegram[0] == (txn->broadcast ? ADR_BROADCAST : ADR_DRIVE));
    if (length == 4 && slot->pdu[0] == READ_COILS) { /* MAP-1 */
        HOLDS(STATUS_REFRESH && pcd == 0 && data[2] == 0 && data[3] == 0);
        return;
    }
    if (length == 4) {
        HOLDS(intent == INTENT_PROCESS);
        HOLDS(pcd == model_word(after, 0));
        HOLDS(((uint32_t)data[2] << 8 | data[3]) == model_word(after, 16));
        return;
    }
    check_parameter_telegram(slot, after, intent);
}

static void keep_telegram(struct slot *slot)
{
    memcpy(slot->telegram, slot->txn->out.telegram, sizeof slot->telegram);
}

static void request(struct bench *b, struct input *in, uint32_t how)
{
    struct slot *slot = &b->slots[how & 1];
    const bool broadcast = (how & 6) == 6;
    const struct translator before = b->t;
    const uint32_t length = take_request(in, slot->pdu);
    struct model after = b->model;
    enum outcome outcome;
    enum intent intent;
    uint32_t i;

    for (i = 0; i < BANK; i++)
        b->bank[i].byte = i < length ? slot->pdu[i] : PATTERN;
    memset(slot->txn, PATTERN, sizeof *slot->txn);
    outcome = translate_request(&b->t, slot->txn, b->bank, length, broadcast);
    HOLDS(same_settings(&before.settings, &b->t.settings) && before.status == b->t.status);
    HOLDS(outcome == OUTCOME_REPLY || outcome == OUTCOME_SILENT || outcome == OUTCOME_EXCHANGE);
    HOLDS(outcome != OUTCOME_SILENT || broadcast || slot->pdu[0] & 0x80);
    intent = model_request(&after, slot->pdu, length);
    check_settings(&b->t.next, &after);
    HOLDS(outcome == OUTCOME_EXCHANGE || intent != INTENT_PROCESS);
    if (outcome == OUTCOME_REPLY)
        check_reply(b, slot, b->t.status);
    if (outcome == OUTCOME_EXCHANGE)
        check_telegram(slot, &after, intent);
    keep_telegram(slot);
    slot->again = false;
    slot->at_drive = false;
    if (how & 0x10) /* revoked */
        return;
    translate_commit(&b->t);
    b->model = after;
    check_settings(&b->t.settings, &b->model);
    slot->at_drive = outcome == OUTCOME_EXCHANGE && !broadcast;
}

static void second_telegram(const struct bench *b, struct slot *slot)
{
    struct model now = b->model;
    uint32_t first_ak;

    /* The index is that of the first telegram, even if it was written since. */
    now.ind = slot->txn->out.telegram[4];
    HOLDS(TRAITS.text_by_size && !slot->again);
    first_ak = slot->telegram[1] >> 4;
    slot->again = true;
    translate_drive_again(slot->txn);
    check_telegram(slot, &now, slot->pdu[0] == READ_REGISTERS ? INTENT_READ : INTENT_WRITE);
    HOLDS(slot->txn->out.telegram[1] >> 4 == (first_ak == AK_TEXT ? AK_READ : AK_TEXT));
    keep_telegram(slot);
}

static void drive_reply(struct bench *b, struct input *in, uint32_t how)
{
    struct slot *slot = &b->slots[how & 1];
    const struct translator before = b->t;
    uint8_t data[DATA_MAX];
    uint32_t length;
    uint32_t i;
    enum outcome outcome;

    if (!slot->at_drive)
        return;
    length = take_telegram(in, slot->telegram, slot->txn->telegram_length, data);
    for (i = 0; i < length; i++)
        b->drive_bank[mailbox_drive_slot(i)].byte = data[i];
    outcome = translate_drive_reply(&b->t, slot->txn, b->drive_bank, length + 2);
    HOLDS(same_settings(&before.settings, &b->t.settings) && before.status == b->t.status);
    /* The second telegram is made from it. */
    HOLDS(!TRAITS.text_by_size || !memcmp(slot->telegram, slot->txn->out.telegram, sizeof slot->telegram));
    HOLDS(outcome == OUTCOME_NOT_A_REPLY || outcome == OUTCOME_REPLY || outcome == OUTCOME_EXCHANGE);
    if (outcome == OUTCOME_REPLY)
        check_reply(b, slot, b->t.next_status);
    if (outcome == OUTCOME_NOT_A_REPLY || how & 0x10) /* its BCC is wrong */
        return;
    HOLDS(length >= 4);
    translate_drive_commit(&b->t);
    HOLDS(same_settings(&before.settings, &b->t.settings));
    if (outcome == OUTCOME_EXCHANGE) {
        second_telegram(b, slot);
        return;
    }
    slot->at_drive = false;
}

static void drive_silent(struct bench *b, uint32_t how)
{
    struct slot *slot = &b->slots[how & 1];
    enum outcome outcome;

    if (!slot->at_drive)
        return;
    outcome = translate_drive_silent(slot->txn);
    HOLDS(outcome == (TRAITS.drive_silent ? OUTCOME_REPLY : OUTCOME_SILENT));
    if (outcome == OUTCOME_REPLY) {
        check_reply(b, slot, b->t.status);
        HOLDS(slot->txn->out.reply[1] == 255);
    }
    slot->at_drive = false;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct mailbox m; /* the diagnostics read the number of restarts */
    struct input in = {data, data + size};
    struct bench b;
    uint32_t step;

    host_connect(&m, 0);
    memset(&b, PATTERN, sizeof b);
    memset(&b.t, 0, sizeof b.t);
    /* Separate blocks, so that the sanitizer sees an access beyond one. */
    b.bank = calloc(BANK, sizeof *b.bank);
    b.drive_bank = calloc(DRIVE_BANK, sizeof *b.drive_bank);
    for (step = 0; step < 2; step++) {
        b.slots[step].txn = malloc(sizeof *b.slots[step].txn);
        b.slots[step].at_drive = false;
    }
    translate_init(&b.t);
    HOLDS(b.t.status == 0);
    model_init(&b.model);
    check_settings(&b.t.settings, &b.model);
    for (step = 0; step < STEPS && in.at < in.end; step++) {
        const uint32_t how = take(&in);

        if (how & 0x80)
            drive_reply(&b, &in, how);
        else if ((how & 0x60) == 0x60)
            drive_silent(&b, how);
        else
            request(&b, &in, how);
    }
    for (step = 0; step < 2; step++)
        free(b.slots[step].txn);
    free(b.bank);
    free(b.drive_bank);
    return 0;
}
