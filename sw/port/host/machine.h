/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An RV32I machine that runs the card's image against the mailbox that host_connect() names. It counts instructions, not
 * clocks. It decodes addresses as rtl/bus_arbiter.v does, and stops at an access that the card does not have.
 */
#ifndef MACHINE_H
#define MACHINE_H

#include <stdbool.h>
#include <stdint.h>

enum { MACHINE_MEMORY = 16384, MACHINE_SP = 2 };

struct machine {
    uint32_t x[32];
    uint32_t pc;
    uint32_t word_flip; /* bits of the next instruction that flip while it is carried out */
    uint32_t instructions;
    uint32_t lowest_sp;
    uint32_t memory_size; /* bytes, without the frame memory */
    uint32_t reads_time;  /* the last instruction read TIME */
    uint8_t memory[MACHINE_MEMORY];
};

/* Loads an image; size and memory are in bytes. */
void machine_load(struct machine *m, const uint8_t *image, uint32_t size, uint32_t memory);

/* `size` bytes of the memory, or of the frame memory at its end; 0 if the address is not aligned. */
uint8_t *machine_place(struct machine *m, uint32_t address, uint32_t size);

/* One instruction. False: the card has no such instruction or no such access. */
bool machine_step(struct machine *m);

/* A round of the poll loop: up to the next reading of TIME, which is undone. False: the firmware hangs, because it takes
 * more than `longest` instructions or stops. A round ends early when the firmware halts the card. */
bool machine_round(struct machine *m, uint32_t longest);

#endif
