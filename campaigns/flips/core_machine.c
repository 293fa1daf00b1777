/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The firmware's image on an RV32I machine with the mailbox model, and one flip in it at a time. core.py says what
 * happens around it, and judges what left.
 *
 * A scenario is a list of steps. In a watched step every instruction is the start of copies of the machine, each with
 * one flip. A copy plays the rest of the scenario. Copies with the same telegrams are counted together.
 *
 * The machine is that of the firmware's tests (sw/port/host/machine.h). A run stops, too, after too long a round.
 */
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "host.h"
#include "mailbox_port.h"

enum {
    STEPS_MAX = 128,
    PDU_MAX = 32,
    SENT_MAX = 12,
    FOUND_MAX = 8192,
    EXAMPLES = 8,
    FIRST_ROUND = 100000, /* instructions; the check of the whole image */
    LAST_PC_BIT = 12,     /* a memory of 8 KiB */
    FIRST_PC_BIT = 2,     /* instructions are aligned */
};

enum step_kind {
    ROUND,          /* of the firmware's loop, from one reading of TIME to the next */
    CANDIDATE,      /* a good frame and half a character */
    COMMIT,         /* t3.5 */
    CHARACTER,      /* before t3.5 */
    TICK,           /* 1/1200 s */
    TELEGRAM_ENDS,  /* if one is on the line */
    EXCHANGE_ROUND, /* a round, if one was */
    DRIVE_SAYS,     /* all but the BCC of its answer; after a broadcast the pause is over */
    DRIVE_ENDS,     /* its BCC */
};

struct step {
    uint8_t kind;
    uint8_t watched;
    uint8_t broadcast;
    uint8_t length;
    uint8_t pdu[PDU_MAX];
};

/* Kinds of flips, as bits: of a register that the instruction reads, of the program counter, of the instruction's word
 * while it is carried out. */
enum flip_kind { OF_REGISTER = 1, OF_PC = 2, OF_WORD = 4, OF_STORE = 8 };

struct flip {
    uint32_t instruction; /* counted from 1 in the watched steps */
    uint32_t pc;
    uint8_t kind;
    uint8_t which; /* the register */
    uint8_t bit;
};

enum ending { PLAYED, REFUSED, STOPPED };

/* What left, and why the firmware stopped if it did. */
struct telegrams {
    uint32_t ending;
    uint32_t sent;
    uint8_t length[SENT_MAX];
    uint8_t byte[SENT_MAX][MAILBOX_FRAME_MAX];
};

struct found {
    struct telegrams telegrams;
    uint32_t count;
    struct flip example[EXAMPLES];
};

struct run {
    uint32_t step;
    uint32_t left; /* instructions until the round is too long */
    bool in_round;
    bool exchanging;
    struct mailbox mailbox;
    struct telegrams out;
    struct machine cpu;
};

/* For core.py; described below. */
void core_load(const uint8_t *bytes, uint32_t size, uint32_t memory, uint32_t longest);
uint32_t core_play(const struct step *scenario, uint32_t count, uint32_t kinds, uint32_t part);
uint32_t core_instructions(void);
const struct found *core_found(uint32_t i);
extern const uint32_t core_found_size;

/* Set by core_load. */
static struct machine loaded;
static uint32_t longest_round;

static struct step steps[STEPS_MAX];
static uint32_t step_count;

static struct found found[FOUND_MAX];
static uint32_t found_count;
static uint32_t instructions;
static bool too_many; /* telegrams of one run */

/* ---- what leaves */

static uint8_t frame_at(uint32_t base, uint32_t i)
{
    return ((volatile uint8_t *)host_frames)[base - FRAMES_address + i * FRAME_STRIDE];
}

static void stop(struct run *m, enum ending ending)
{
    m->out.ending = ending;
    m->step = step_count;
}

/* After everything that may start a telegram: keeps it, without its BCC. */
static void collect(struct run *m, uint32_t sent_before)
{
    struct telegrams *out = &m->out;
    const uint32_t length = m->mailbox.telegram_length;
    uint32_t i;

    if (m->mailbox.unknown != 0)
        stop(m, STOPPED);
    if (m->mailbox.broken & BROKEN_BCC) {
        stop(m, REFUSED);
        return;
    }
    if (m->mailbox.sent_telegrams == sent_before)
        return;
    if (out->sent == SENT_MAX) {
        too_many = true;
        return;
    }
    out->length[out->sent] = (uint8_t)(length - 1);
    for (i = 0; i < length - 1; i++)
        out->byte[out->sent][i] = frame_at(TELEGRAM_FRAME_address, i);
    out->sent++;
}

/* ---- the machine */

static bool execute(struct run *m)
{
    const uint32_t sent = m->mailbox.sent_telegrams;

    host_connect(&m->mailbox, 0);
    if (!machine_step(&m->cpu))
        return false;
    collect(m, sent);
    return true;
}

/* One instruction of a round. Its end is the next reading of TIME, which is undone. */
static void advance(struct run *m)
{
    const uint32_t pc = m->cpu.pc;
    const bool first = !m->in_round;

    if (first) {
        m->in_round = true;
        m->left = longest_round;
    }
    if (!execute(m) || m->left-- == 0) {
        stop(m, STOPPED);
        return;
    }
    if (m->cpu.reads_time && !first) {
        m->cpu.pc = pc;
        m->in_round = false;
        m->step++;
    }
}

/* ---- the scenario */

/* What a drive answers to the telegram that left last: a value of the asked kind. */
static void drive_says(struct run *m)
{
    static const uint8_t status[] = {0x0F, 0x03, 0x20, 0x00};
    const uint8_t *asked = m->out.byte[m->out.sent - 1] + 1; /* after ADR */
    const uint32_t length = m->out.length[m->out.sent - 1] - 1u;
    uint8_t data[MAILBOX_FRAME_MAX];

    if (length < sizeof status)
        return;
    memcpy(data, asked, length - sizeof status);
    memcpy(data + length - sizeof status, status, sizeof status);
    if (length > sizeof status) {
        const uint32_t ak = asked[0] >> 4;

        data[0] = (uint8_t)((ak == 1 ? 2 : ak == 2 ? 1 : 15) << 4 | (asked[0] & 0x0F));
    }
    mailbox_drive_data(&m->mailbox, data, length, length + 2);
}

/* ADR 20h to 3Fh, or 80h: all drives. */
static bool is_broadcast(uint8_t adr)
{
    return adr == 0x80 || (adr >= 0x20 && adr <= 0x3F);
}

static void event(struct run *m, const struct step *step)
{
    struct mailbox *mailbox = &m->mailbox;
    const uint32_t sent = mailbox->sent_telegrams;

    m->step++;
    switch (step->kind) {
    case CANDIDATE:
        mailbox_candidate(mailbox, 1, step->pdu, step->length, step->broadcast);
        break;
    case COMMIT:
        mailbox_commit(mailbox);
        break;
    case CHARACTER:
        mailbox_character(mailbox);
        break;
    case TICK:
        mailbox->ticks++;
        break;
    case TELEGRAM_ENDS:
        m->exchanging = mailbox->sending && m->out.sent != 0;
        if (m->exchanging && mailbox_is_touched(mailbox))
            stop(m, STOPPED);
        else if (m->exchanging)
            mailbox_telegram_ends(mailbox);
        break;
    case DRIVE_SAYS:
        if (m->exchanging && is_broadcast(m->out.byte[m->out.sent - 1][0]))
            mailbox_pause_over(mailbox);
        else if (m->exchanging)
            drive_says(m);
        break;
    case DRIVE_ENDS:
        if (m->exchanging && !is_broadcast(m->out.byte[m->out.sent - 1][0]))
            mailbox_bcc(mailbox, true);
        break;
    default:
        break;
    }
    collect(m, sent);
}

/* Whether the next thing is an instruction; if not, the next event happens. */
static bool is_at_instruction(struct run *m)
{
    const struct step *step = steps + m->step;

    if (step->kind == ROUND || (step->kind == EXCHANGE_ROUND && (m->exchanging || m->in_round)))
        return true;
    event(m, step);
    return false;
}

static void play_on(struct run *m)
{
    while (m->step < step_count)
        if (is_at_instruction(m))
            advance(m);
}

static void start(struct run *m)
{
    memset(m, 0, sizeof *m);
    m->cpu = loaded;
    mailbox_init(&m->mailbox);
    host_connect(&m->mailbox, 0);
    if (!machine_round(&m->cpu, FIRST_ROUND))
        stop(m, STOPPED);
}

/* ---- flips */

static struct found *find(const struct telegrams *telegrams)
{
    uint32_t i;

    for (i = 0; i < found_count; i++)
        if (memcmp(&found[i].telegrams, telegrams, sizeof *telegrams) == 0)
            return found + i;
    if (found_count == FOUND_MAX)
        return 0;
    found[found_count].telegrams = *telegrams;
    found[found_count].count = 0;
    return found + found_count++;
}

/* Registers that an instruction reads, as bits; x0 is none. */
static uint32_t registers_read(uint32_t word)
{
    const uint32_t opcode = word & 0x7F, rs1 = 1u << (word >> 15 & 31), rs2 = 1u << (word >> 20 & 31);

    if (opcode == 0x63 || opcode == 0x23 || opcode == 0x33)
        return (rs1 | rs2) & ~1u;
    return opcode == 0x67 || opcode == 0x03 || opcode == 0x13 ? rs1 & ~1u : 0;
}

static bool try_flip(const struct run *sound, const struct flip *flip)
{
    static struct run m;
    uint32_t frames[FRAMES_bytes / sizeof(uint32_t)];
    struct found *kept;

    memcpy(frames, (const void *)host_frames, sizeof frames);
    m = *sound;
    if (flip->kind == OF_PC)
        m.cpu.pc ^= 1u << flip->bit;
    else if (flip->kind == OF_WORD)
        m.cpu.word_flip = 1u << flip->bit;
    else
        m.cpu.x[flip->which] ^= 1u << flip->bit;
    advance(&m);
    play_on(&m);
    kept = find(&m.out);
    memcpy((void *)host_frames, frames, sizeof frames);
    if (!kept)
        return false;
    if (kept->count < EXAMPLES)
        kept->example[kept->count] = *flip;
    kept->count++;
    return true;
}

static bool try_bits(const struct run *m, struct flip flip, uint32_t kind, uint32_t first, uint32_t last)
{
    flip.kind = (uint8_t)kind;
    for (; first <= last; first++) {
        flip.bit = (uint8_t)first;
        if (!try_flip(m, &flip))
            return false;
    }
    return true;
}

static bool try_all(struct run *m, uint32_t kinds)
{
    struct flip flip = {.instruction = instructions, .pc = m->cpu.pc};
    uint32_t word, which;
    bool room = true;

    memcpy(&word, machine_place(&m->cpu, m->cpu.pc, 4), 4);
    if (kinds & OF_STORE && (word & 0x7F) != 0x23)
        return true;
    for (which = 1; which < 32; which++)
        if (kinds & (OF_REGISTER | OF_STORE) && registers_read(word) >> which & 1) {
            flip.which = (uint8_t)which;
            room &= try_bits(m, flip, OF_REGISTER, 0, kinds & OF_STORE ? 6 : 31);
        }
    flip.which = 0;
    if (kinds & OF_PC)
        room &= try_bits(m, flip, OF_PC, FIRST_PC_BIT, LAST_PC_BIT);
    if (kinds & OF_WORD)
        room &= try_bits(m, flip, OF_WORD, 0, 31);
    return room;
}

/* ---- for core.py */

const uint32_t core_found_size = sizeof(struct found);

/* memory, longest: bytes of memory, and instructions of a round. */
void core_load(const uint8_t *bytes, uint32_t size, uint32_t memory, uint32_t longest)
{
    machine_load(&loaded, bytes, size, memory);
    longest_round = longest;
}

/*
 * Plays a scenario without a flip, and with each one of `kinds` before every `part`-th instruction. Returns the number of
 * results, or 0 if there are too many of them, of steps or of telegrams. The first one, uncounted, is that without a flip.
 */
uint32_t core_play(const struct step *scenario, uint32_t count, uint32_t kinds, uint32_t part)
{
    static struct run m;
    bool room = true;

    if (count > STEPS_MAX)
        return 0;
    memcpy(steps, scenario, count * sizeof *scenario);
    step_count = count;
    found_count = 1;
    instructions = 0;
    too_many = false;
    start(&m);
    memset(found, 0, sizeof *found);
    while (m.step < step_count) {
        if (!is_at_instruction(&m))
            continue;
        if (steps[m.step].watched && ++instructions % part == 0 && kinds != 0)
            room &= try_all(&m, kinds);
        advance(&m);
    }
    found[0].telegrams = m.out;
    return room && !too_many ? found_count : 0;
}

uint32_t core_instructions(void)
{
    return instructions;
}

const struct found *core_found(uint32_t i)
{
    return found + i;
}
