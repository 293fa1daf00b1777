/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fuzzes the firmware against the model of the mailbox (sw/port/host/mailbox_model.h). Events come in any order, some
 * between two register accesses of one round: candidates, commits, revokes, telegrams of the drive, time, restarts, the
 * loop-back test. Here is what makes the events and what judges. The image check runs as in main.c.
 *
 * Checked: a process telegram carries coils 1-32 as they are, and goes to all only if each write that it stands for does.
 * No other telegram carries coils. A parameter is that of the request; only a write writes one, to RAM or EEPROM as coil 65
 * says. Coils read as they were written, bit by bit; those of the status are the last of a good reply. When both lines rest,
 * the last process telegram carries coils 1-32 (SAFE-8). A changed image leaves before all else; a committed parameter write
 * leaves unless a newer one of its kind replaces it or the line is never silent (FRAME-7). A telegram is sent twice at most.
 * A reply fits its request and confirms only what the drive has answered. A broadcast gets no reply. The settings are those
 * of the committed requests. After the last event a new request is answered and reaches the drive.
 */
#include <string.h>

#include "codes.h"
#include "fuzz.h"
#include "gateway.h"
#include "host.h"
#include "image.h"
#include "mailbox_model.h"
#include "mailbox_port.h"
#include "ticks.h"

enum { EVENTS = 300, ADDRESS = 85, EVENT_FLAGS = 8 };
enum { SENDING = TICKS(40) }; /* a telegram of 32 bytes takes 37 ms */
/* Requests at once: at the drive, in the telegram's place, two writes that wait, a write of which the second telegram may
 * follow, the last of coils, the newest, one more. */
enum { REQUESTS = 8 };
enum { FOR_ONE, FOR_ALL, UNITS };
/* As in main.c, with a smaller image. */
enum { IMAGE_WORDS = 300, IDLE_WORDS = 1, START_WORDS = 64 };

struct request {
    uint32_t length;
    uint32_t sent;
    enum intent intent;
    uint32_t status; /* coils 33-64 as it came */
    struct model after;
    uint8_t pdu[PDU_MAX];
    bool broadcast;
    bool committed;
    bool drive_answered; /* the drive sent a good telegram after ours */
};

static struct mailbox m;
static struct gateway g;
static struct model model;
static struct request requests[REQUESTS];
static struct request *newest;
static uint16_t counted[EVENT_FLAGS], repeats;
static uint8_t reply[MAILBOX_FRAME_MAX]; /* that left last */
static uint32_t replies, telegrams;      /* judged; they left */
static uint32_t sent_at;                 /* when the last telegram left */
static struct request *at_drive;      /* of the last telegram that left */
static bool repeated;                 /* that was the repeat of the one before it */
static uint8_t last[TELEGRAM_MAX];    /* its bytes */
static struct request *writes[UNITS]; /* committed parameter writes that have not left */
static struct request *may_follow;    /* the last write for one that has left: its second telegram may leave, too */
static uint32_t commits, order[UNITS]; /* how many; that of each of these */
static uint32_t commits_before;       /* the last telegram left for the first time */
static struct request *of_coils;      /* the last write of coils that was committed */
static bool changed[UNITS];           /* writes of coils were committed since the last telegram of the image left */
static bool due;                      /* and the firmware has seen it */
static bool writes_due;               /* likewise of parameter writes */
static bool told;                     /* since the start a telegram of the image has left */
static uint32_t last_image;           /* its words */
static uint32_t status, heard_status; /* coils 33-64; what the drive's last telegram with a good BCC makes of them */
static uint32_t coming_status;        /* likewise of its last telegram */
static bool polled;   /* the firmware has had its rounds since the last candidate, commit or restart */
/* Rounds in which the firmware must see the commit: one prepares, the next commits. */
static uint32_t rounds_to_commit;
static uint32_t rounds_to_bcc; /* in which it must see the BCC of the drive's last telegram */
static uint32_t race_in; /* register accesses until race_event */
static uint32_t race_event;
static struct input *input;

/* ---- transmissions */

/* The model numbers a request by its place in requests, from 1 on. */
static struct request *by_number(uint32_t number)
{
    return number != 0 ? requests + number - 1 : NULL;
}

static bool is_write(const struct request *request)
{
    return request->intent == INTENT_PROCESS || request->intent == INTENT_WRITE;
}

static bool image_changed(void)
{
    return changed[FOR_ONE] || changed[FOR_ALL];
}

static uint32_t image_words_of_model(void)
{
    return model_word(&model, 16) << 16 | model_word(&model, 0);
}

/* The text that follows a number of one or two registers, which the drive has refused (MAP-8). */
static bool is_second(void)
{
    if (!TRAITS.text_by_size || m.kind != KIND_ONE || writes[FOR_ONE] || !may_follow || m.again ||
        !memcmp(m.telegram, last, m.telegram_length))
        return false;
    HOLDS(may_follow->pdu[0] == 0x10 && may_follow->pdu[4] <= 2 && may_follow->drive_answered);
    HOLDS(m.telegram[1] >> 4 == 15);
    return true;
}

/* The request of a telegram that leaves for the first time. */
static struct request *request_of_telegram(void)
{
    const uint32_t unit = m.kind == KIND_ALL ? FOR_ALL : FOR_ONE;
    struct request *request = writes[unit];

    if (m.kind == KIND_IMAGE)
        return of_coils;
    if (m.kind == KIND_NEWEST)
        return by_number(m.asker);
    if (is_second()) {
        request = may_follow;
        may_follow = NULL;
        return request;
    }
    HOLDS(request && (!writes[!unit] || order[unit] < order[!unit]));
    writes[unit] = NULL;
    if (unit == FOR_ONE)
        may_follow = request;
    return request;
}

/* A repeat is ordered anew after a commit of its kind that asks the drive for nothing (FC-9). */
static bool is_repeat(void)
{
    if (m.again || m.kind == KIND_NEWEST || is_second())
        return m.again;
    return m.kind == KIND_IMAGE ? !image_changed() : !writes[m.kind == KIND_ALL ? FOR_ALL : FOR_ONE];
}

static void check_image(uint32_t words)
{
    HOLDS(words == image_words_of_model());
    HOLDS(repeated || m.no_reply == !changed[FOR_ONE]);
    changed[FOR_ONE] = changed[FOR_ALL] = due = false;
    told = true;
    last_image = words;
}

static void check_parameter(void)
{
    const uint8_t *data = m.telegram + 1;
    const uint32_t pnu = (data[0] & 0x0Fu) << 8 | data[1];
    const bool reads = at_drive->intent == INTENT_READ;
    const bool stored = at_drive->after.coils[64];

    HOLDS(reads ? at_drive->pdu[4] <= 10 : at_drive->intent == INTENT_WRITE);
    HOLDS(pnu >= 1 && pnu <= TRAITS.pnu_max);
    HOLDS(10 * pnu - 1 == ((uint32_t)at_drive->pdu[1] << 8 | at_drive->pdu[2]));
    HOLDS(data[3] == (at_drive->after.ind & 0xFF));
    switch (data[0] >> 4) {
    case AK_READ:
        HOLDS(reads && data[2] == 0);
        break;
    case AK_WRITE_WORD:
    case AK_WRITE_DOUBLE:
        HOLDS(!reads && data[2] == 0 && !stored);
        break;
    case AK_STORE - AK_WRITE_WORD:
    case AK_STORE - AK_WRITE_DOUBLE:
        HOLDS(!reads && data[2] == 0 && stored);
        break;
    case AK_TEXT:
        HOLDS(data[2] == (reads ? 4 : 5));
        HOLDS(!reads || m.telegram_length == 14);
        break;
    default:
        NEVER("an AK that the card sends");
    }
}

static void check_telegram(void)
{
    const uint8_t *pcd = m.telegram + m.telegram_length - 5;
    const uint32_t words = (uint32_t)pcd[2] << 24 | (uint32_t)pcd[3] << 16 | (uint32_t)pcd[0] << 8 | pcd[1];

    HOLDS(bcc_fits(m.telegram, m.telegram_length) == !m.loopback);
    if (m.loopback) {
        HOLDS(m.telegram_length == 14 && !(words & 0x0400));
        HOLDS(m.telegram[1] == 0); /* AK 0 */
        return;
    }
    repeated = is_repeat();
    if (!repeated) {
        at_drive = request_of_telegram();
        commits_before = commits;
    }
    HOLDS(at_drive && at_drive->committed);
    HOLDS(m.telegram[0] == (m.no_reply ? ADR_BROADCAST : ADR_DRIVE));
    HOLDS(m.kind == KIND_IMAGE || m.no_reply == at_drive->broadcast);
    HOLDS(++at_drive->sent <= (TRAITS.text_by_size ? 4 : 2));
    /* A repeat is never a broadcast. That of a reading does not follow a commit since it left. */
    HOLDS(!repeated || (!m.no_reply && !memcmp(m.telegram, last, m.telegram_length)));
    HOLDS(!repeated || commits == commits_before || is_write(at_drive));
    memcpy(last, m.telegram, m.telegram_length);
    if (m.kind == KIND_IMAGE) {
        HOLDS(m.telegram_length == 6 && at_drive->sent <= 2);
        check_image(words);
        return;
    }
    HOLDS(words == 0 && !due);
    HOLDS(!writes_due || at_drive == newest || is_write(at_drive));
    if (m.telegram_length == 6)
        HOLDS(STATUS_REFRESH && at_drive->pdu[0] == 0x01);
    else
        check_parameter();
}

/* Whether the reply about coils is right with these coils 33-64. */
static bool reads_coils(uint32_t coils_of_drive)
{
    const uint8_t *pdu = newest->pdu;
    const uint32_t first = (uint32_t)pdu[1] << 8 | pdu[2];
    const uint32_t quantity = (uint32_t)pdu[3] << 8 | pdu[4];
    uint32_t i;

    if (first + quantity > 128 || reply[2] != (quantity + 7) / 8)
        return false;
    for (i = 0; i < 8u * reply[2]; i++) {
        const bool of_drive = first + i >= 32 && first + i < 64;
        const bool is = i < quantity && (of_drive ? coils_of_drive >> (first + i - 32) & 1 : newest->after.coils[first + i]);

        if ((reply[3 + i / 8] >> i % 8 & 1) != is)
            return false;
    }
    return true;
}

static void check_reply(void)
{
    const uint8_t *pdu = reply + 1;

    if (m.loopback)
        return;
    HOLDS(newest && newest->committed && !newest->broadcast);
    HOLDS(reply[0] == ADDRESS);
    if (pdu[0] & 0x80) {
        HOLDS(pdu[0] == (newest->pdu[0] | 0x80) && m.reply_length == 3);
        return;
    }
    HOLDS(pdu[0] == newest->pdu[0]);
    if (diagnoses(pdu[0]))
        return;
    /* The status may have changed since it came. */
    if (pdu[0] == 0x01)
        HOLDS(reads_coils(newest->status) || reads_coils(status) || reads_coils(heard_status));
    if (pdu[0] == 0x03)
        HOLDS(pdu[1] == 2u * newest->pdu[4]);
    if (pdu[0] == 0x01 || pdu[0] == 0x03)
        HOLDS(m.reply_length == 3u + pdu[1]);
    else
        HOLDS(m.reply_length == 6 && !memcmp(pdu, newest->pdu, 5));
    HOLDS(newest->drive_answered || newest->intent != INTENT_PROCESS);
    HOLDS(newest->drive_answered || newest->sent == 0);
}

/* Checks what left with the last event. */
static void judge(void)
{
    if (m.sent_replies != replies) {
        uint32_t i;

        replies++;
        for (i = 0; i < m.reply_length; i++)
            reply[i] = mailbox_frame(REPLY_FRAME)[i].byte;
        check_reply();
    }
    if (m.sent_telegrams != telegrams) {
        telegrams++;
        sent_at = m.ticks;
        check_telegram();
    }
}

/* ---- events */

static uint32_t free_request(void)
{
    uint32_t number = 1;

    while (number == m.asker || by_number(number) == at_drive || by_number(number) == of_coils ||
           by_number(number) == writes[FOR_ONE] || by_number(number) == writes[FOR_ALL] ||
           by_number(number) == may_follow)
        number++;
    return number;
}

static void event_candidate(void)
{
    const uint32_t number = free_request();

    newest = by_number(number);
    memset(newest, 0, sizeof *newest);
    newest->length = take_request(input, newest->pdu);
    newest->broadcast = (take(input) & 7) == 7;
    newest->after = model;
    newest->status = status;
    newest->intent = model_request(&newest->after, newest->pdu, newest->length);
    mailbox_candidate(&m, number, newest->pdu, newest->length, newest->broadcast);
    polled = false;
}

static void event_commit(void)
{
    const uint32_t unit = newest->broadcast ? FOR_ALL : FOR_ONE;

    newest->committed = true;
    commits++;
    model = newest->after;
    rounds_to_commit = polled ? 1 : 2;
    if (newest->intent == INTENT_WRITE) {
        writes[unit] = newest;
        order[unit] = commits;
        if (unit == FOR_ONE)
            may_follow = NULL;
    }
    if (newest->intent == INTENT_PROCESS) {
        changed[unit] = true;
        of_coils = newest;
    }
    polled = false;
    mailbox_commit(&m);
    judge();
}

static void event_telegram_ends(void)
{
    HOLDS(!m.sending || !mailbox_is_touched(&m));
    mailbox_telegram_ends(&m);
}

static void event_bcc(bool good)
{
    if (m.drive_candidate && good && !m.loopback) {
        heard_status = coming_status;
        if (at_drive)
            at_drive->drive_answered = true;
    }
    rounds_to_bcc = 2;
    mailbox_bcc(&m, good);
    judge();
}

/* The loop-back test: each port receives what the other sends, in most cases intact. */
static void hear_telegram(void)
{
    const uint32_t damage = take(input);
    uint8_t heard[MAILBOX_FRAME_MAX] = {0x02, (uint8_t)m.telegram_length};
    uint32_t i;

    memcpy(heard + 2, m.telegram, m.telegram_length);
    if (damage & 0x80)
        heard[damage & 15] ^= 0x10;
    for (i = 0; i < m.telegram_length + 2; i++)
        if (m.bank)
            mailbox_frame(REQUEST_FRAME_0)[i].byte = heard[i];
        else
            mailbox_frame(REQUEST_FRAME_1)[i].byte = heard[i];
}

static void hear_frame(void)
{
    static const uint8_t wrong_crc[] = {0x27, 0xB7};
    const uint32_t damage = take(input);
    uint8_t heard[MAILBOX_FRAME_MAX + sizeof wrong_crc];

    memcpy(heard, reply, m.reply_length);
    memcpy(heard + m.reply_length, wrong_crc, sizeof wrong_crc);
    if (damage & 0x80)
        heard[3 + (damage & 7)] ^= 0x10;
    if (m.reply_length > 3)
        mailbox_drive_data(&m, heard + 3, m.reply_length - 1, heard[1]);
}

static void drive_says(const uint8_t *data, uint32_t length)
{
    const uint8_t *pcd = data + length - 4;

    /* A telegram takes longer than its BCC, and than the firmware takes for a round. */
    if (m.drive_candidate || rounds_to_bcc != 0)
        return;
    if (length >= 4 && m.listening && !m.drive_good)
        coming_status = (uint32_t)pcd[2] << 24 | (uint32_t)pcd[3] << 16 | (uint32_t)pcd[0] << 8 | pcd[1];
    mailbox_drive_data(&m, data, length, length + 2);
}

static void hear_drive(void)
{
    uint8_t data[DATA_MAX];
    const uint32_t length = take_telegram(input, m.telegram, m.telegram_length, data);

    drive_says(data, length);
}

static void small_event(uint32_t which)
{
    switch (which & 7) {
    case 0:
        mailbox_character(&m);
        break;
    case 1:
        if (m.loopback && m.sending)
            hear_telegram();
        event_telegram_ends();
        break;
    case 2:
        event_bcc(true);
        break;
    case 3:
        event_bcc(false);
        break;
    case 4:
        mailbox_pause_over(&m);
        judge();
        break;
    case 5:
        m.quiet = false;
        m.heard |= !m.sending;
        break;
    case 6:
        if (m.is_candidate)
            event_commit();
        break;
    default:
        if (m.loopback)
            hear_frame();
        else
            hear_drive();
        break;
    }
}

/* ---- registers */

static void race(void)
{
    if (race_in != 0 && --race_in == 0)
        small_event(race_event);
}

static uint32_t on_read(uint32_t offset)
{
    uint32_t value;

    race();
    value = mailbox_on_read(&m, offset);
    HOLDS(m.unknown == 0);
    return value;
}

static void check_counters(void)
{
    const volatile uint16_t *counter = mailbox_counter(COUNT_CRC);
    uint32_t i;

    if (DIAGNOSTICS) /* a master may clear them (MAP-10) */
        return;
    for (i = 0; i < EVENT_FLAGS; i++, counter += FRAME_STRIDE / sizeof *counter)
        HOLDS(*counter == counted[i]);
    HOLDS(*mailbox_counter(COUNT_DRIVE_REPEAT) == repeats);
}

/* Of every register that the firmware writes here. */
static void check_write(uint32_t offset, uint32_t value)
{
    const uint32_t reply_length = MAILBOX_FIELD(REPLY, LENGTH, value);
    const uint32_t length = MAILBOX_FIELD(TELEGRAM, LENGTH, value);
    const uint32_t action = MAILBOX_FIELD(TELEGRAM, ACTION, value);

    HOLDS(offset != offsetof(MAILBOX_t, WATCHDOG));
    HOLDS(offset != offsetof(MAILBOX_t, LED) || value <= 0x0F);
    HOLDS(offset != offsetof(MAILBOX_t, LISTEN) || value <= MAILBOX__LISTEN__ON_bm);
    HOLDS(offset != offsetof(MAILBOX_t, SUPERVISOR) || value == MAILBOX__SUPERVISOR__LOOPBACK_bm);
    if (offset == offsetof(MAILBOX_t, REPLY))
        HOLDS(reply_length == 0 || (reply_length >= 3 && reply_length <= 1 + REPLY_PDU_MAX));
    if (offset == offsetof(MAILBOX_t, EVENTS)) {
        uint32_t i;

        HOLDS(value != 0 && (value & ~m.events) == 0);
        for (i = 0; i < EVENT_FLAGS; i++)
            counted[i] = (uint16_t)(counted[i] + (value >> i & 1));
    }
    if (offset != offsetof(MAILBOX_t, TELEGRAM))
        return;
    HOLDS(!m.sending);
    if (action == MAILBOX__TELEGRAM__ACTION__REPEAT)
        repeats++;
    else
        HOLDS(length == 6 || (length >= 12 && length <= TELEGRAM_MAX && !(length & 1)));
}

static void on_write(uint32_t offset, uint32_t value)
{
    race();
    check_write(offset, value);
    mailbox_on_write(&m, offset, value);
    HOLDS(m.unknown == 0);
    judge();
}

/* ---- the firmware */

static struct image image;
static uint32_t image_words[IMAGE_WORDS + 2];

static bool check_words(uint32_t words)
{
    return image_step(&image, image_words, image_words + IMAGE_WORDS, words);
}

static void seal_image(void)
{
    uint32_t i;

    for (i = 0; i < IMAGE_WORDS; i++) {
        image_words[i] = i * 0x9E3779B9u;
        image_words[IMAGE_WORDS] += image_words[i];
        image_words[IMAGE_WORDS + 1] += image_words[IMAGE_WORDS];
    }
}

static void restart(void)
{
    if (m.loopback)
        event_telegram_ends();
    mailbox_restart(&m);
    newest = NULL;
    model_init(&model);
    memset(&g, 0, sizeof g);
    writes[FOR_ONE] = writes[FOR_ALL] = of_coils = may_follow = NULL;
    changed[FOR_ONE] = changed[FOR_ALL] = due = writes_due = told = false;
    polled = false;
    rounds_to_commit = rounds_to_bcc = 0;
    race_in = 0;
    status = heard_status = coming_status = 0;
    image_begin(&image, image_words);
    gateway_init(&g);
}

static void poll(void)
{
    const uint32_t to_see = rounds_to_commit;

    if (gateway_poll(&g))
        HOLDS(check_words(IDLE_WORDS));
    HOLDS(g.translator.status == status || g.translator.status == heard_status);
    status = g.translator.status;
    if (rounds_to_commit != 0 && to_see != 0)
        rounds_to_commit--;
    if (rounds_to_bcc != 0)
        rounds_to_bcc--;
    polled = rounds_to_commit == 0;
    if (!polled)
        return;
    due = image_changed();
    writes_due = writes[FOR_ONE] || writes[FOR_ALL];
    check_counters();
    check_settings(&g.translator.settings, &model);
}

/* Lets time pass as if idle polls had followed it. */
static void skip(uint32_t ticks)
{
    m.ticks += ticks;
    g.now += ticks;
}

static void wait(uint32_t polls, uint32_t step)
{
    for (; polls != 0; polls--) {
        m.ticks += step;
        if (m.sending && m.ticks - sent_at > SENDING)
            event_telegram_ends();
        poll();
        /* The exchange sees the time that the round before has read. */
        if (step > 1)
            poll();
    }
}

/* A restart, event flags, or a change of the line. Returns the input byte, which also selects the polls after it. */
static uint32_t hardware_event(void)
{
    const uint32_t how = take(input);

    if (how == PATTERN)
        restart();
    else if (how & 0x80)
        m.events |= how & ((1u << EVENT_FLAGS) - 1);
    else
        small_event(4 + (how & 1));
    return how;
}

static void event(uint32_t how)
{
    switch (how & 15) {
    case 0:
    case 1:
        /* What the loop-back test hears of itself is no request. */
        if (!m.is_candidate && polled && !(m.loopback && m.sending))
            event_candidate();
        break;
    case 2:
        if (m.is_candidate)
            event_commit();
        break;
    case 8:
        wait(1, 1);
        break;
    case 9:
        wait(take(input), 1);
        break;
    case 10:
        wait(1, take(input));
        break;
    case 7:
        skip(take(input) << (how >> 4));
        wait(1, 1);
        break;
    case 11:
        race_event = take(input);
        race_in = 1 + (race_event >> 4);
        break;
    case 12:
        how = hardware_event();
        break;
    case 13:
        image_begin(&image, image_words);
        HOLDS(check_words(START_WORDS));
        break;
    case 14:
    case 15:
        small_event(7);
        break;
    default:
        small_event(how - 3);
        break;
    }
    if (!(how & 0x10))
        poll();
    if (how & 0x20)
        poll();
}

/* ---- the end of a run: the card must still work */

static void come_to_rest(void)
{
    uint32_t round;

    race_in = 0;
    mailbox_character(&m);
    for (round = 0; round < 16; round++) {
        mailbox_pause_over(&m);
        judge();
        poll();
        event_telegram_ends();
        event_bcc(false);
        skip(TICKS(12500) + ticks_of_tens(model.drive_timeout));
        wait(3, 1);
    }
    HOLDS(!m.loopback && gateway_is_idle(&g));
    HOLDS(!m.telegram_queued && !m.sending);
    HOLDS(!image_changed() && (!told || last_image == image_words_of_model())); /* SAFE-8 */
    HOLDS(!writes[FOR_ONE] && !writes[FOR_ALL]);
}

/* Plays a committed request made from the bytes of pdu; returns the number of replies sent. */
static uint32_t ask(const uint8_t *pdu, size_t length)
{
    struct input in = {pdu, pdu + length};
    const uint32_t before = replies;

    input = &in;
    event_candidate();
    poll();
    event_commit();
    poll();
    poll();
    return replies - before;
}

static void serve(void)
{
    /* Input of take_request: 03 of local registers, 03 of a parameter; no broadcast. */
    static const uint8_t local[] = {0x11, 1, 0};
    static const uint8_t parameter[] = {0x09, 2, 1, 0};
    uint8_t data[12] = {0};
    uint32_t before;

    HOLDS(ask(local, sizeof local) == 1);
    HOLDS(reply[1] == 0x03 && reply[2] == 2);
    HOLDS(reply[3] << 8 == (model.network_timeout & 0xFF00) && reply[4] == (model.network_timeout & 0xFF));
    before = telegrams;
    HOLDS(ask(parameter, sizeof parameter) == 0);
    HOLDS(telegrams == before + 1);
    event_telegram_ends();
    poll();
    memcpy(data, m.telegram + 1, 4);
    if (data[0] >> 4 == 15) {
        data[4] = data[5] = 'A';
        drive_says(data, 10);
    } else
        drive_says(data, 12);
    poll();
    before = replies;
    event_bcc(true);
    HOLDS(replies == before + 1);
    HOLDS(reply[1] == 0x03);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct input in = {data, data + size};
    uint32_t events;
    uint32_t start;

    if (image_words[IMAGE_WORDS] == 0)
        seal_image();
    mailbox_init(&m);
    m.address = ADDRESS;
    memset(requests, 0, sizeof requests);
    memset(counted, 0, sizeof counted);
    repeats = commits = 0;
    at_drive = NULL;
    replies = telegrams = 0;
    input = &in;
    start = take(input);
    m.loopback = (start & 0x0F) == 0x0F;
    m.ticks = start << 8;
    m.outside = start;
    host_connect(&m, NULL);
    host_watch(~0u, ~0u, on_read, on_write);
    restart();
    for (events = 0; events < EVENTS && in.at < in.end; events++)
        event(take(&in));
    come_to_rest();
    serve();
    return 0;
}
