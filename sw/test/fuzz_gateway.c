/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fuzzes the poll loop against a model of the mailbox. Events come in any order, some between two register accesses
 * of one round: candidates, commits, revokes, telegrams of the drive, time, restarts, the loop-back test. The model
 * follows the rules of rtl/gate/commit_gate.v. The image check runs as in main.c.
 *
 * Checked: a process telegram carries the coils of its own committed request, and is sent twice at most. No other
 * telegram carries coils. A write that waits in its place leaves unless a newer one of its kind replaces it. A held
 * telegram does not leave long after the commit of a newer one. A reply fits its request, confirms only commands that the drive has answered, and never answers a broadcast. The settings are those of the
 * committed requests. After the last event a new request is answered and reaches the drive.
 */
#include <string.h>

#include "fuzz.h"
#include "gateway.h"
#include "host.h"
#include "image.h"
#include "mailbox_port.h"
#include "ticks.h"

enum { EVENTS = 300, ADDRESS = 85, FRAME_MAX = 32, CRC_BYTES = 2, EVENT_FLAGS = 8 };
/* Ticks. FC-9 gives up a telegram 150 ms after a newer one waits. A telegram of 32 bytes takes 37 ms. */
enum { HELD = TICKS(150) + 6, SENDING = TICKS(40) };
/* Requests at once: at the drive, one in each place, the newest, and one that it replaced. */
enum { REQUESTS = PLACES + 3 };
/* As in main.c, with a smaller image. */
enum { IMAGE_WORDS = 300, IDLE_WORDS = 2, START_WORDS = 64 };

struct request {
    uint8_t pdu[PDU_MAX];
    uint32_t length;
    struct model after;
    enum intent intent;
    bool broadcast;
    bool committed;
    bool ignored;    /* came during the loop-back test or before a restart */
    bool drive_answered; /* the drive sent a good telegram after ours */
    uint32_t sent;
};

static struct {
    uint32_t time; /* ticks */
    bool loopback;
    uint32_t events;
    uint16_t counted[EVENT_FLAGS];
    uint16_t repeats;
    /* network side */
    uint32_t ticket, bank, length;
    bool candidate, committed, broadcast, answerable, spent, reply_queued, wait_drive;
    uint8_t reply[FRAME_MAX];
    uint32_t reply_length, replies;
    /* drive side */
    bool queued, licensed, begun, newest, repeatable, control;
    struct request *waiting[PLACES]; /* committed writes, by enum place */
    bool kept;                       /* the candidate is to wait once it is committed */
    bool started, sending, no_reply, quiet, listening, drive_candidate, drive_good;
    uint8_t telegram[FRAME_MAX];
    uint32_t telegram_length, telegrams, sent_at;
} m;

static struct gateway g;
static struct model model;
static struct request requests[REQUESTS];
static struct request *newest, *at_drive;
static uint32_t held; /* ticks that the queued telegram was held after the commit of a newer request */
static bool polled;   /* the firmware has had its rounds since the last candidate, commit or restart */
/* Rounds in which the firmware must see the commit: one prepares, the next commits. */
static uint32_t rounds_to_commit;
static uint32_t race_in; /* register accesses until race_event */
static uint32_t race_event;
static struct input *input;

/* ---- frame memory */

static bool telegram_untouched(void)
{
    uint32_t i;

    for (i = 0; i < m.telegram_length; i++)
        if (mailbox_frame(TELEGRAM_FRAME)[i].byte != m.telegram[i])
            return false;
    return true;
}

static void end_licence(void)
{
    m.queued = m.licensed = false;
}

/* A write to the telegram memory ends the licence. */
static void end_touched_licence(void)
{
    if (!telegram_untouched())
        end_licence();
}

static void drop_unlicensed(void)
{
    if (!m.licensed)
        m.queued = false;
}

/* ---- transmissions */

static bool is_write(const struct request *request)
{
    return request->intent == INTENT_PROCESS || request->intent == INTENT_WRITE;
}

static void check_telegram(void)
{
    const uint8_t *pcd = m.telegram + m.telegram_length - 5;
    const uint32_t control = (uint32_t)pcd[0] << 8 | pcd[1];
    const uint32_t reference = (uint32_t)pcd[2] << 8 | pcd[3];

    HOLDS(bcc_fits(m.telegram, m.telegram_length) == !m.loopback);
    if (m.loopback) {
        HOLDS(m.telegram_length == 14 && !(control & 0x0400));
        HOLDS(m.telegram[1] == 0); /* AK 0 */
        return;
    }
    HOLDS(at_drive && at_drive->committed && !at_drive->ignored);
    HOLDS(m.telegram[0] == (at_drive->broadcast ? ADR_BROADCAST : ADR_DRIVE));
    HOLDS(m.no_reply == at_drive->broadcast);
    HOLDS(++at_drive->sent <= (BY_SIZE ? 4 : 2));
    HOLDS(held <= HELD);
    /* A repeat is never a broadcast. That of a reading never follows the commit of a newer request. */
    HOLDS(at_drive->sent == 1 || !at_drive->broadcast);
    HOLDS(at_drive->sent == 1 || BY_SIZE || at_drive == newest || !newest->committed || is_write(at_drive));
    if (m.telegram_length == 6) {
        HOLDS(at_drive->intent == INTENT_PROCESS);
        HOLDS(control == model_word(&at_drive->after, 0) && reference == model_word(&at_drive->after, 16));
        HOLDS(at_drive->sent <= 2);
    } else {
        HOLDS(at_drive->intent == INTENT_READ || at_drive->intent == INTENT_WRITE);
        HOLDS(control == 0 && reference == 0);
        HOLDS(at_drive->intent == INTENT_WRITE || m.telegram[1] >> 4 == 1 || m.telegram[1] >> 4 == 15);
    }
}

static void check_reply(void)
{
    const uint8_t *pdu = m.reply + 1;

    m.replies++;
    if (m.loopback)
        return;
    HOLDS(newest && newest->committed && !newest->ignored && !newest->broadcast);
    HOLDS(m.reply[0] == ADDRESS);
    if (pdu[0] & 0x80) {
        HOLDS(pdu[0] == (newest->pdu[0] | 0x80) && m.reply_length == 3);
        return;
    }
    HOLDS(pdu[0] == newest->pdu[0]);
    if (diagnoses(pdu[0]))
        return;
    if (pdu[0] == 0x01 || pdu[0] == 0x03)
        HOLDS(m.reply_length == 3u + pdu[1]);
    else
        HOLDS(m.reply_length == 6 && !memcmp(pdu, newest->pdu, 5));
    HOLDS(newest->drive_answered || newest->intent != INTENT_PROCESS);
    HOLDS(newest->drive_answered || newest->sent == 0);
}

static void release(void)
{
    if (m.reply_queued && (m.answerable || m.loopback) && (!m.wait_drive || m.drive_good)) {
        m.reply_queued = m.answerable = false;
        m.spent = true;
        if (m.newest && !m.loopback)
            end_licence();
        check_reply();
    }
    end_touched_licence();
    if (m.queued && m.licensed && m.quiet) {
        m.queued = m.listening = m.drive_candidate = m.drive_good = false;
        m.started = m.sending = true;
        m.licensed = m.repeatable && !m.begun;
        m.spent |= m.newest && m.control;
        m.begun = true;
        m.sent_at = m.time;
        m.telegrams++;
        check_telegram();
    }
}

/* ---- events */

static struct request *free_request(void)
{
    struct request *request = requests;

    while (request == at_drive || request == m.waiting[0] || request == m.waiting[PLACES - 1])
        request++;
    return request;
}

static uint32_t place(const struct request *request)
{
    return request->broadcast ? PLACE_BROADCAST : PLACE_UNICAST;
}

/* The newest request gives its licence to the place of its kind. A telegram that is repeated there ends its own. */
static void keep(void)
{
    if (place(newest) >= PLACES)
        return;
    HOLDS(is_write(newest));
    m.waiting[place(newest)] = newest;
    m.spent |= newest->intent == INTENT_PROCESS;
}

static void event_candidate(void)
{
    uint32_t i;

    newest = free_request();
    memset(newest, 0, sizeof *newest);
    newest->length = take_request(input, newest->pdu);
    newest->broadcast = (take(input) & 7) == 7;
    newest->ignored = m.loopback;
    newest->after = model;
    newest->intent = model_request(&newest->after, newest->pdu, newest->length);
    m.bank ^= 1;
    for (i = 0; i < FRAME_MAX; i++) {
        uint8_t byte = newest->broadcast ? 0 : ADDRESS;

        if (i != 0)
            byte = i <= newest->length ? newest->pdu[i - 1] : PATTERN;
        if (m.bank)
            mailbox_frame(REQUEST_FRAME_1)[i].byte = byte;
        else
            mailbox_frame(REQUEST_FRAME_0)[i].byte = byte;
    }
    m.length = newest->length + 1 + CRC_BYTES;
    m.ticket = (m.ticket + 1) & MAILBOX__REQUEST__TICKET_bm;
    m.candidate = true;
    m.committed = m.answerable = m.reply_queued = m.kept = false;
    m.broadcast = newest->broadcast;
    drop_unlicensed();
    polled = false;
}

static void event_commit(void)
{
    m.candidate = m.spent = false;
    m.committed = m.answerable = true;
    if (m.licensed) {
        m.newest = m.repeatable = false;
        if (m.begun)
            end_licence();
    } else if (m.queued) {
        m.licensed = true;
        m.control = newest->intent == INTENT_PROCESS;
    }
    if (m.kept)
        keep();
    m.kept = false;
    newest->committed = true;
    if (!newest->ignored) {
        model = newest->after;
        rounds_to_commit = polled ? 1 : 2;
    }
    polled = false;
    release();
}

static void event_character(void)
{
    m.answerable = m.reply_queued = false;
    if (m.candidate) {
        m.candidate = m.kept = false;
        drop_unlicensed();
    }
}

static void event_telegram_ends(void)
{
    if (m.sending) {
        HOLDS(telegram_untouched());
        m.sending = false;
        m.listening = !m.no_reply;
    }
}

static void event_drive_data(const uint8_t *data, uint32_t length)
{
    uint32_t i;

    if (!m.listening || m.drive_good)
        return;
    for (i = 0; i < length; i++)
        mailbox_frame(DRIVE_FRAME)[place_of(i)].byte = data[i];
    mailbox_frame(DRIVE_LGE)->byte = (uint8_t)(length + 2);
    m.drive_candidate = true;
}

static void event_bcc(bool good)
{
    if (!m.drive_candidate)
        return;
    m.drive_candidate = false;
    m.drive_good = good;
    if (good && at_drive)
        at_drive->drive_answered = true;
    if (!good && m.wait_drive)
        m.reply_queued = false;
    release();
}

/* The loop-back test: each port receives what the other sends, in most cases intact. */
static void hear_telegram(void)
{
    const uint32_t damage = take(input);
    uint8_t heard[FRAME_MAX] = {0x02, (uint8_t)m.telegram_length};
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
    uint8_t heard[FRAME_MAX + sizeof wrong_crc];

    memcpy(heard, m.reply, m.reply_length);
    memcpy(heard + m.reply_length, wrong_crc, sizeof wrong_crc);
    if (damage & 0x80)
        heard[3 + (damage & 7)] ^= 0x10;
    if (m.reply_length > 3) {
        event_drive_data(heard + 3, m.reply_length - 1);
        mailbox_frame(DRIVE_LGE)->byte = heard[1];
    }
}

static void hear_drive(void)
{
    uint8_t data[DATA_MAX];

    event_drive_data(data, take_telegram(input, m.telegram, m.telegram_length, data));
}

static void small_event(uint32_t which)
{
    switch (which & 7) {
    case 0:
        event_character();
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
        m.quiet = true;
        release();
        break;
    case 5:
        m.quiet = false;
        break;
    case 6:
        if (m.candidate)
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
    race();
    switch (offset) {
    case offsetof(MAILBOX_t, TIME):
        return m.time & MAILBOX__TIME__TICKS_bm;
    case offsetof(MAILBOX_t, EVENTS):
        return m.events;
    case offsetof(MAILBOX_t, REQUEST):
        return m.ticket | (m.candidate ? MAILBOX__REQUEST__CANDIDATE_bm : 0u) |
               (m.committed ? MAILBOX__REQUEST__COMMITTED_bm : 0u) |
               (m.broadcast ? MAILBOX__REQUEST__BROADCAST_bm : 0u) |
               (m.bank ? MAILBOX__REQUEST__BANK_bm : 0u);
    case offsetof(MAILBOX_t, LENGTH):
        return m.length & MAILBOX__LENGTH__BYTES_bm;
    case offsetof(MAILBOX_t, EXCHANGE):
        end_touched_licence();
        return (m.queued ? MAILBOX__EXCHANGE__QUEUED_bm : 0u) |
               (m.sending ? MAILBOX__EXCHANGE__SENDING_bm : 0u) |
               (m.started ? MAILBOX__EXCHANGE__STARTED_bm : 0u) |
               (m.drive_candidate ? MAILBOX__EXCHANGE__CANDIDATE_bm : 0u) |
               (m.drive_good ? MAILBOX__EXCHANGE__GOOD_bm : 0u) |
               (m.loopback ? MAILBOX__EXCHANGE__LOOPBACK_bm : 0u) |
               (m.quiet && !m.sending && !m.candidate ? MAILBOX__EXCHANGE__SILENT_bm : 0u);
    default:
        NEVER("a register that the firmware reads");
    }
    return 0;
}

static void queue_reply(uint32_t value)
{
    const uint32_t ticket = (value & MAILBOX__REPLY__TICKET_bm) >> MAILBOX__REPLY__TICKET_bp;
    const bool alive = m.candidate || (m.committed && m.answerable);
    uint32_t i;

    m.reply_length = (value & MAILBOX__REPLY__LENGTH_bm) >> MAILBOX__REPLY__LENGTH_bp;
    HOLDS(m.reply_length == 0 || (m.reply_length >= 3 && m.reply_length <= 1 + REPLY_PDU_MAX));
    m.reply_queued =
        ((ticket == m.ticket && alive && !m.broadcast) || m.loopback) && m.reply_length > 0;
    m.wait_drive = (value & MAILBOX__REPLY__AFTER_DRIVE_bm) != 0;
    m.spent |= ticket == m.ticket && m.broadcast;
    for (i = 0; i < m.reply_length; i++)
        m.reply[i] = mailbox_frame(REPLY_FRAME)[i].byte;
}

static void queue_telegram(uint32_t value)
{
    const uint32_t ticket = (value & MAILBOX__TELEGRAM__TICKET_bm) >> MAILBOX__TELEGRAM__TICKET_bp;
    const uint32_t action = (value & MAILBOX__TELEGRAM__ACTION_bm) >> MAILBOX__TELEGRAM__ACTION_bp;
    const bool mine = ticket == m.ticket;
    struct request *asker = newest;
    uint32_t i;

    if (action == MAILBOX__TELEGRAM__ACTION__KEEP) {
        m.kept = mine && m.candidate;
        if (mine && m.committed && !m.spent)
            keep();
        return;
    }
    HOLDS(!m.sending);
    held = 0;
    m.started = false;
    end_touched_licence();
    if (action == MAILBOX__TELEGRAM__ACTION__REPEAT) {
        m.repeats++;
        m.queued = m.licensed && m.begun && m.repeatable;
        return;
    }
    m.begun = false;
    m.no_reply = (value & MAILBOX__TELEGRAM__NO_REPLY_bm) != 0;
    if (action == MAILBOX__TELEGRAM__ACTION__WAITING) {
        struct request **from = &m.waiting[m.no_reply ? PLACE_BROADCAST : PLACES - 1];

        asker = *from;
        *from = NULL;
        m.licensed = m.queued = asker != NULL;
        m.control = asker && asker->intent == INTENT_PROCESS;
        m.newest = mine;
        m.repeatable = !m.no_reply;
    } else {
        m.licensed = (mine && m.committed && !m.spent) || m.loopback;
        m.queued = m.licensed || (mine && m.candidate);
        m.control = m.licensed && !m.loopback && newest->intent == INTENT_PROCESS;
        m.newest = true;
        m.repeatable = !m.broadcast;
    }
    m.telegram_length = (value & MAILBOX__TELEGRAM__LENGTH_bm) >> MAILBOX__TELEGRAM__LENGTH_bp;
    HOLDS(m.telegram_length == 6 || (m.telegram_length >= 12 && m.telegram_length <= TELEGRAM_MAX));
    HOLDS(!(m.telegram_length & 1));
    for (i = 0; i < m.telegram_length; i++)
        m.telegram[i] = mailbox_frame(TELEGRAM_FRAME)[i].byte;
    if (m.queued)
        at_drive = asker;
}

static void count_events(uint32_t flags)
{
    uint32_t i;

    m.events &= ~flags;
    for (i = 0; i < EVENT_FLAGS; i++)
        m.counted[i] = (uint16_t)(m.counted[i] + (flags >> i & 1));
}

static void check_counters(void)
{
    const volatile uint16_t *counter = mailbox_counter(COUNT_CRC);
    uint32_t i;

    if (DIAGNOSTICS) /* a master may clear them (MAP-10) */
        return;
    for (i = 0; i < EVENT_FLAGS; i++, counter += FRAME_STRIDE / sizeof *counter)
        HOLDS(*counter == m.counted[i]);
    HOLDS(*mailbox_counter(COUNT_DRIVE_REPEAT) == m.repeats);
}

static void on_write(uint32_t offset, uint32_t value)
{
    race();
    switch (offset) {
    case offsetof(MAILBOX_t, LED):
        HOLDS(value <= 0x0F);
        break;
    case offsetof(MAILBOX_t, EVENTS):
        HOLDS(value != 0 && (value & ~m.events) == 0);
        count_events(value);
        break;
    case offsetof(MAILBOX_t, REPLY):
        queue_reply(value);
        break;
    case offsetof(MAILBOX_t, TELEGRAM):
        queue_telegram(value);
        break;
    case offsetof(MAILBOX_t, LISTEN):
        HOLDS(value <= MAILBOX__LISTEN__ON_bm);
        m.listening = value != 0;
        m.drive_candidate = m.drive_good = false;
        break;
    case offsetof(MAILBOX_t, SUPERVISOR):
        HOLDS(value == MAILBOX__SUPERVISOR__LOOPBACK_bm);
        m.loopback = false;
        m.reply_queued = false;
        end_licence();
        break;
    default:
        NEVER("a register that the firmware writes");
    }
    release();
}

/* ---- the firmware */

static struct image image;
static uint32_t image_words[IMAGE_WORDS + 2];

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
    m.queued = m.licensed = m.reply_queued = m.kept = m.listening = m.started = false;
    memset(m.waiting, 0, sizeof m.waiting);
    m.sending = m.sending && !m.loopback;
    newest = at_drive = NULL;
    if (m.candidate || m.committed) {
        newest = requests;
        newest->ignored = true;
    }
    model_init(&model);
    memset(&g, 0, sizeof g);
    polled = false;
    rounds_to_commit = 0;
    race_in = 0;
    image_init(&image, image_words, image_words + IMAGE_WORDS);
    gateway_init(&g);
}

static void poll(void)
{
    const uint32_t to_see = rounds_to_commit;
    const struct settings *s = &g.translator.settings;

    gateway_poll(&g);
    if (gateway_is_idle(&g))
        HOLDS(image_step(&image, IDLE_WORDS));
    end_touched_licence();
    if (rounds_to_commit != 0 && to_see != 0)
        rounds_to_commit--;
    polled = rounds_to_commit == 0;
    if (!polled)
        return;
    check_counters();
    HOLDS((s->word[CONTROL] & 0xFFFF) == model_word(&model, 0));
    HOLDS(s->word[CONTROL] >> 16 == model_word(&model, 16));
    HOLDS(s->word[EEPROM] == (model.coils[64] ? 1u : 0u) && s->word[LOCAL_IND] == model.ind);
    HOLDS(s->word[LOCAL_NETWORK_TIMEOUT] == model.network_timeout);
    HOLDS(s->word[LOCAL_DRIVE_TIMEOUT] == model.drive_timeout);
    HOLDS(translate_is_sound(&g.translator));
    /* (docs/hardening.md, Licence ends with the exchange) */
    HOLDS(g.exchange != EXCHANGE_IDLE || g.testing || !m.licensed);
}

/* Lets time pass as if idle polls had followed it. */
static void skip(uint32_t ticks)
{
    m.time += ticks;
    g.now += ticks;
}

static void wait(uint32_t polls, uint32_t step)
{
    for (; polls != 0; polls--) {
        m.time += step;
        if (step != 0 && m.queued && m.waiting[g.next] && !rounds_to_commit)
            held += step;
        if (m.sending && m.time - m.sent_at > SENDING)
            event_telegram_ends();
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
        if (!m.candidate && polled)
            event_candidate();
        break;
    case 2:
        if (m.candidate)
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
        image_init(&image, image_words, image_words + IMAGE_WORDS);
        HOLDS(image_step(&image, START_WORDS));
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
    event_character();
    for (round = 0; round < 8; round++) {
        m.quiet = true;
        release();
        poll();
        event_telegram_ends();
        event_bcc(false);
        skip(TICKS(12500) + ticks_of_tens(model.drive_timeout));
        wait(3, 1);
    }
    HOLDS(!g.testing && !m.loopback && gateway_is_idle(&g));
    HOLDS(!m.queued && !m.sending && !m.waiting[0] && !m.waiting[PLACES - 1]);
}

/* Plays a committed request made from the bytes of pdu; returns the number of replies sent. */
static uint32_t ask(const uint8_t *pdu, size_t length)
{
    struct input in = {pdu, pdu + length};
    const uint32_t before = m.replies;

    input = &in;
    event_candidate();
    poll();
    event_commit();
    poll();
    poll();
    return m.replies - before;
}

static void serve(void)
{
    /* Input of take_request: 03 of local registers, 03 of a parameter; no broadcast. */
    static const uint8_t local[] = {0x11, 1, 0};
    static const uint8_t parameter[] = {0x09, 2, 1, 0};
    uint8_t data[12] = {0};
    uint32_t telegrams;

    HOLDS(ask(local, sizeof local) == 1);
    HOLDS(m.reply[1] == 0x03 && m.reply[2] == 2);
    HOLDS(m.reply[3] << 8 == (model.network_timeout & 0xFF00) && m.reply[4] == (model.network_timeout & 0xFF));
    telegrams = m.telegrams;
    HOLDS(ask(parameter, sizeof parameter) == 0);
    HOLDS(m.telegrams == telegrams + 1);
    event_telegram_ends();
    poll();
    memcpy(data, m.telegram + 1, 4);
    if (data[0] >> 4 == 15) {
        data[4] = data[5] = 'A';
        event_drive_data(data, 10);
    } else
        event_drive_data(data, 12);
    poll();
    telegrams = m.replies;
    event_bcc(true);
    HOLDS(m.replies == telegrams + 1);
    HOLDS(m.reply[1] == 0x03);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct input in = {data, data + size};
    uint32_t events;
    uint32_t start;

    if (image_words[IMAGE_WORDS] == 0)
        seal_image();
    memset(&m, 0, sizeof m);
    memset((void *)host_frames, 0, sizeof host_frames);
    memset(requests, 0, sizeof requests);
    m.quiet = true;
    input = &in;
    start = take(input);
    m.loopback = (start & 0x0F) == 0x0F;
    m.time = start << 8;
    host_connect(on_read, on_write);
    restart();
    for (events = 0; events < EVENTS && in.at < in.end; events++)
        event(take(&in));
    come_to_rest();
    serve();
    return 0;
}
