/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Translation between Modbus PDUs and FC telegrams, free of hardware.
 *
 * One request is one transaction. It is prepared early and committed late (FRAME-6), in these calls:
 *   translate_request       decodes the PDU and prepares reply or telegram; takes effect with the commit
 *   translate_commit        applies the settings of a committed request; a revoked request gets no such call
 *   translate_drive_reply   prepares the Modbus reply before the BCC of the drive's telegram arrives
 *   translate_drive_commit  after a good BCC: updates the status coils (FC-6)
 *   translate_drive_again   after translate_drive_commit: prepares a second telegram, if one is needed
 *   translate_drive_silent  after the time-out (FC-9): prepares exception 255, or no reply
 * Several transactions may exist at once: one at the drive, those that wait for it, and the newest request (FRAME-7).
 * Only the newest has uncommitted settings, only the one at the drive a status.
 *
 * PDU: function code and data, without address and CRC. Telegram: ADR, data and BCC, without STX and LGE; its
 * length is the LGE. Lengths are in bytes. Frames are laid out as in the frame memory (frame.h).
 */
#ifndef TRANSLATE_H
#define TRANSLATE_H

#include <stdbool.h>
#include <stdint.h>

#include "frame.h"
#include "transaction.h"

/* t is all zero. */
void translate_init(struct translator *t);

/* pdu_length: the length received, even if only the first 31 bytes were stored (FRAME-5). */
enum outcome translate_request(struct translator *t, struct transaction *txn, frame_byte *pdu,
                               uint32_t pdu_length, bool broadcast);

void translate_commit(struct translator *t);

/* data: byte i of the telegram's data at index i, from byte 24 on at 24 + i % 4; lge as received. */
enum outcome translate_drive_reply(struct translator *t, struct transaction *txn, frame_byte *data,
                                   uint32_t lge);

void translate_drive_commit(struct translator *t);

/* After OUTCOME_EXCHANGE of translate_drive_reply: asks for the number as text, or the other way (MAP-8 of some
 * dialects). */
void translate_drive_again(struct transaction *txn);

enum outcome translate_drive_silent(struct transaction *txn);

/* The start bit of the control image is 1 (SAFE-7). */
bool translate_is_running(const struct translator *t);

/* The control image with the start bit 0 and the data-valid bit 1 (SAFE-7). */
uint32_t translate_stopped(const struct translator *t);

/* Makes the telegram of this control image (FRAME-7): CTW, and REF in the high half. */
void translate_image(struct transaction *txn, uint32_t control, bool broadcast);

#endif
