# SPDX-License-Identifier: Apache-2.0
"""A small RV32I machine that runs the card's firmware image against a mailbox simulated by a test.

It counts instructions, not clocks. Like the card it rejects multiplication, unaligned access, access to
registers and frame bytes in another size than their own, and addresses outside the memory.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

from regs.generated.mailbox import AREAS, BASE, FRAMES, FRAMES_BYTES, REGISTERS
from tb.model.firmware import build, frame_memory

MASK = 0xFFFFFFFF
SP, STACK_FILL = 2, 0x5A
# Access size in bytes by offset in the frame memory.
SIZES = {area.at(i): area.size for area in AREAS.values() for i in range(area.length)}
LONGEST_ROUND = 100_000  # instructions; the check of the whole image at the start is the longest


class Hung(Exception):
    """The firmware stopped polling; the card's watchdog would bite."""


@functools.cache
def image(dialect: str = "card") -> bytes:
    """The firmware image, as loaded into the card."""
    folder = "build" if dialect == "card" else f"build/{dialect}"
    return build(f"{folder}/firmware.bin").read_bytes()


def signed(value: int, bits: int = 32) -> int:
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


def alu(funct3: int, alternate: bool, a: int, b: int) -> int:
    match funct3:
        case 0:
            return (a - b if alternate else a + b) & MASK
        case 1:
            return a << (b & 31) & MASK
        case 2:
            return int(signed(a) < signed(b))
        case 3:
            return int(a < b)
        case 4:
            return a ^ b
        case 5:
            return (signed(a) >> (b & 31)) & MASK if alternate else a >> (b & 31)
        case 6:
            return a | b
        case _:
            return a & b


def taken(funct3: int, a: int, b: int) -> bool:
    if funct3 & 4:
        less = a < b if funct3 & 2 else signed(a) < signed(b)
        return less != bool(funct3 & 1)
    return (a == b) != bool(funct3 & 1)


class Machine:
    """Same interface as firmware.Gateway: `poll` runs one round of the loop, which starts by reading TIME."""

    def __init__(
        self,
        read: Callable[[int], int],
        write: Callable[[int, int], None],
        memory: int = 8192,
        damaged_bit: int | None = None,
        dialect: str = "card",
        program: bytes | None = None,
    ) -> None:
        self.on_read, self.on_write = read, write
        program = program or image(dialect)
        self.image_size = len(program)
        self.memory = bytearray(program.ljust(memory - FRAMES_BYTES, bytes([STACK_FILL])))
        if damaged_bit is not None:
            self.memory[damaged_bit // 8] ^= 1 << damaged_bit % 8
        self.decoded: dict[int, Callable[[], None]] = {}
        self.x = [0] * 32
        self.pc = 0
        self.instructions = 0
        self.longest_round = LONGEST_ROUND
        self.lowest_sp = len(self.memory)
        # The first read of TIME belongs to the start.
        self._run_to_time()
        self.poll()

    def poll(self) -> None:
        self._step()  # the read of TIME
        self._run_to_time()

    def _run_to_time(self) -> None:
        self.reads_time = False
        last = self.instructions + self.longest_round
        while not self.reads_time:
            if self.instructions > last:
                raise Hung(f"no read of TIME for {self.longest_round} instructions, now at {self.pc:#x}")
            pc = self.pc
            self._step()
        # Undo the last step: the loop stops just before its read of TIME.
        self.pc = pc
        self.instructions -= 1

    def _step(self) -> None:
        execute = self.decoded.get(self.pc)
        if execute is None:
            execute = self.decoded[self.pc] = self._decode(self.pc)
        self.pc += 4
        self.instructions += 1
        execute()

    # ------------------------------------------------------------ memory

    def _load(self, address: int, size: int) -> int:
        assert address % size == 0, f"unaligned load at {self.pc - 4:#x}"
        if address >= FRAMES:
            at = self._frame_access(address, size)
            return int.from_bytes(frame_memory()[at : at + size], "little")
        if address >= BASE:
            offset = self._register_access(address, size)
            self.reads_time |= offset == REGISTERS["TIME"].offset
            return self.on_read(offset)
        assert address + size <= len(self.memory), f"load outside the memory at {self.pc - 4:#x}"
        return int.from_bytes(self.memory[address : address + size], "little")

    def _store(self, address: int, size: int, value: int) -> None:
        assert address % size == 0, f"unaligned store at {self.pc - 4:#x}"
        data = (value & ((1 << 8 * size) - 1)).to_bytes(size, "little")
        if address >= FRAMES:
            at = self._frame_access(address, size)
            frame_memory()[at : at + size] = data
            return
        if address >= BASE:
            self.on_write(self._register_access(address, size), value)
            return
        assert self.image_size <= address <= len(self.memory) - size, f"store into code at {self.pc - 4:#x}"
        self.memory[address : address + size] = data

    def _frame_access(self, address: int, size: int) -> int:
        """Offset in the frame memory. The firmware uses only this address for the memory's last 256 bytes."""
        at = address - FRAMES
        assert SIZES.get(at) == size, f"{size} bytes of the frame memory at {at:#x}, at {self.pc - 4:#x}"
        return at

    def _register_access(self, address: int, size: int) -> int:
        offset = address - BASE
        sizes = {register.size for register in REGISTERS.values() if register.offset == offset}
        assert sizes == {size}, f"{size} bytes of the registers at {offset:#x}, at {self.pc - 4:#x}"
        return offset

    # ------------------------------------------------------------ instructions

    def _decode(self, pc: int) -> Callable[[], None]:
        """The instruction at pc as a function without arguments."""
        word = int.from_bytes(self.memory[pc : pc + 4], "little")
        x = self.x
        opcode, rd, funct3 = word & 0x7F, word >> 7 & 31, word >> 12 & 7
        rs1, rs2, funct7 = word >> 15 & 31, word >> 20 & 31, word >> 25
        imm_i = signed(word >> 20, 12)
        imm_s = signed(funct7 << 5 | rd, 12)

        def set_rd(value: int) -> None:
            if rd:
                x[rd] = value & MASK

        match opcode:
            case 0x37:
                return lambda: set_rd(word & 0xFFFFF000)
            case 0x17:
                return lambda: set_rd(pc + (word & 0xFFFFF000))
            case 0x6F:
                bits = (
                    word >> 31 << 20
                    | (word >> 12 & 0xFF) << 12
                    | (word >> 20 & 1) << 11
                    | (word >> 21 & 0x3FF) << 1
                )
                target = pc + signed(bits, 21)

                def jal() -> None:
                    set_rd(pc + 4)
                    self.pc = target

                return jal
            case 0x67:

                def jalr() -> None:
                    target = x[rs1] + imm_i & MASK & ~1
                    set_rd(pc + 4)
                    self.pc = target

                return jalr
            case 0x63:
                bits = funct7 >> 6 << 12 | (rd & 1) << 11 | (funct7 & 0x3F) << 5 | (rd & ~1)
                target = pc + signed(bits, 13)

                def branch() -> None:
                    if taken(funct3, x[rs1], x[rs2]):
                        self.pc = target

                return branch
            case 0x03:
                size, unsigned = 1 << (funct3 & 3), bool(funct3 & 4)

                def load() -> None:
                    value = self._load(x[rs1] + imm_i & MASK, size)
                    set_rd(value if unsigned else signed(value, 8 * size))

                return load
            case 0x23:
                size = 1 << funct3
                return lambda: self._store(x[rs1] + imm_s & MASK, size, x[rs2])
            case 0x13 if rd == rs1 == SP:

                def move_sp() -> None:
                    x[SP] += imm_i
                    self.lowest_sp = min(self.lowest_sp, x[SP])

                return move_sp
            case 0x13:
                alternate = funct3 == 5 and funct7 == 0x20
                return lambda: set_rd(alu(funct3, alternate, x[rs1], imm_i & MASK))
            case 0x33 if funct7 in (0, 0x20):
                alternate = funct7 == 0x20
                return lambda: set_rd(alu(funct3, alternate, x[rs1], x[rs2]))
        raise AssertionError(f"no RV32I instruction at {pc:#x}: {word:08x}")
