/* SPDX-License-Identifier: Apache-2.0 */
#include "machine.h"

#include <string.h>

#include "host.h"
#include "mailbox_port.h"

enum { STACK_FILL = 0x5A, REGISTERS_SPAN = 32 /* bytes after which the registers repeat */ };

#define REGISTER(name) [offsetof(MAILBOX_t, name)] = sizeof(((MAILBOX_t *)0)->name)
/* The size of an access by its offset; 0: nothing is there. */
static const uint8_t register_size[REGISTERS_SPAN] = {
    REGISTER(REQUEST), REGISTER(EXCHANGE), REGISTER(LENGTH), REGISTER(TIME),     REGISTER(EVENTS),    REGISTER(REPLY),
    REGISTER(TELEGRAM), REGISTER(LED),     REGISTER(LISTEN), REGISTER(WATCHDOG), REGISTER(SUPERVISOR),
};

void machine_load(struct machine *m, const uint8_t *image, uint32_t size, uint32_t memory)
{
    memset(m, 0, sizeof *m);
    memset(m->memory, STACK_FILL, sizeof m->memory);
    memcpy(m->memory, image, size < MACHINE_MEMORY ? size : MACHINE_MEMORY);
    m->memory_size = m->lowest_sp = memory - FRAMES_bytes;
}

static uint32_t extended(uint32_t value, uint32_t bits)
{
    const uint32_t sign = 1u << (bits - 1);

    return (value ^ sign) - sign;
}

static bool is_register(uint32_t address)
{
    return address >> 31 && !(address >> 10 & 1);
}

/* A memory repeats over all addresses: 16 and 8 KiB whole, and of 6 KiB the last 2 KiB, where 8 KiB would go on. */
uint8_t *machine_place(struct machine *m, uint32_t address, uint32_t size)
{
    const uint32_t end = m->memory_size + FRAMES_bytes;

    if (address % size != 0)
        return 0;
    address &= MACHINE_MEMORY - 1;
    if (address >= end)
        address -= MACHINE_MEMORY - end;
    return address < m->memory_size ? m->memory + address : (uint8_t *)host_frames + (address - m->memory_size);
}

/* LB, LH, LW, LBU, LHU. */
static bool load(struct machine *m, uint32_t address, uint32_t funct3, uint32_t *value)
{
    const uint32_t size = 1u << (funct3 & 3);
    const uint32_t offset = address % REGISTERS_SPAN;
    const uint8_t *place = is_register(address) ? 0 : machine_place(m, address, size);

    if (funct3 == 3 || funct3 > 5)
        return false;
    if (place) {
        memcpy(value, place, size);
    } else if (is_register(address) && register_size[offset] == size) {
        m->reads_time |= offset == offsetof(MAILBOX_t, TIME);
        *value = host_read(offset);
    } else {
        return false;
    }
    if (funct3 < 2)
        *value = extended(*value & (funct3 ? 0xFFFFu : 0xFFu), 8 * size);
    return true;
}

static bool store(struct machine *m, uint32_t address, uint32_t size, uint32_t value)
{
    const uint32_t offset = address % REGISTERS_SPAN;
    uint8_t *place;

    if (is_register(address)) {
        if (register_size[offset] != size)
            return false;
        host_write(offset, value);
        return true;
    }
    place = machine_place(m, address, size);
    if (place)
        memcpy(place, &value, size);
    return place != 0;
}

static uint32_t alu(uint32_t funct3, bool alternate, uint32_t a, uint32_t b)
{
    switch (funct3) {
    case 0:
        return alternate ? a - b : a + b;
    case 1:
        return a << (b & 31);
    case 2:
        return (int32_t)a < (int32_t)b;
    case 3:
        return a < b;
    case 4:
        return a ^ b;
    case 5:
        return alternate ? (uint32_t)((int32_t)a >> (b & 31)) : a >> (b & 31);
    case 6:
        return a | b;
    default:
        return a & b;
    }
}

static bool taken(uint32_t funct3, uint32_t a, uint32_t b)
{
    const bool less = funct3 & 2 ? a < b : (int32_t)a < (int32_t)b;

    return (funct3 & 4 ? less : a == b) != (funct3 & 1);
}

bool machine_step(struct machine *m)
{
    const uint32_t pc = m->pc;
    const uint8_t *place = machine_place(m, pc, 4);
    uint32_t word;
    uint32_t opcode;
    uint32_t rd;
    uint32_t funct3;
    uint32_t a;
    uint32_t b;
    uint32_t imm;
    uint32_t value = 0;

    if (!place)
        return false;
    memcpy(&word, place, 4);
    word ^= m->word_flip;
    m->word_flip = 0;
    opcode = word & 0x7F;
    rd = word >> 7 & 31;
    funct3 = word >> 12 & 7;
    a = m->x[word >> 15 & 31];
    b = m->x[word >> 20 & 31];
    imm = extended(word >> 20, 12);
    m->pc = pc + 4;
    m->reads_time = false;
    m->instructions++;
    switch (opcode) {
    case 0x37:
        value = word & 0xFFFFF000;
        break;
    case 0x17:
        value = pc + (word & 0xFFFFF000);
        break;
    case 0x6F:
        imm = word >> 31 << 20 | (word >> 12 & 0xFF) << 12 | (word >> 20 & 1) << 11 | (word >> 21 & 0x3FF) << 1;
        value = pc + 4;
        m->pc = pc + extended(imm, 21);
        break;
    case 0x67:
        value = pc + 4;
        m->pc = (a + imm) & ~1u;
        break;
    case 0x63:
        if (funct3 == 2 || funct3 == 3)
            return false;
        imm = word >> 31 << 12 | (rd & 1) << 11 | (word >> 25 & 0x3F) << 5 | (rd & 30);
        if (taken(funct3, a, b))
            m->pc = pc + extended(imm, 13);
        return true;
    case 0x03:
        if (!load(m, a + imm, funct3, &value))
            return false;
        break;
    case 0x23:
        imm = extended(word >> 25 << 5 | rd, 12);
        return funct3 < 3 && store(m, a + imm, 1u << funct3, b);
    case 0x13:
        value = alu(funct3, funct3 == 5 && word >> 25 == 0x20, a, imm);
        break;
    case 0x33:
        if (word >> 25 != 0 && word >> 25 != 0x20)
            return false;
        value = alu(funct3, word >> 25 == 0x20, a, b);
        break;
    default:
        return false;
    }
    if (rd != 0)
        m->x[rd] = value;
    if (rd == MACHINE_SP && opcode == 0x13 && value < m->lowest_sp)
        m->lowest_sp = value;
    return true;
}

bool machine_round(struct machine *m, uint32_t longest)
{
    bool first = true;

    for (;;) {
        const uint32_t pc = m->pc;

        if (!machine_step(m) || longest-- == 0)
            return false;
        if (host_is_halted())
            return true;
        if (m->reads_time && !first) {
            m->pc = pc;
            m->instructions--;
            return true;
        }
        first = false;
    }
}
