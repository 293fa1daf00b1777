# SPDX-License-Identifier: Apache-2.0
"""Fields, registers and areas of the mailbox map, whose rows are regs/generated/mailbox.py."""

from dataclasses import dataclass

STRIDE = 4  # bytes from one byte of a frame to the next


@dataclass(frozen=True)
class Field:
    """One field; reset is None if it has none, and so is its port of rtl/mailbox_regs.v."""

    bit: int
    width: int
    reset: int | None
    port: str | None = None
    pulse: bool = False

    def get(self, word: int) -> int:
        """The field's value inside a register word."""
        return (word >> self.bit) & ((1 << self.width) - 1)

    def put(self, value: int) -> int:
        """A register word with this field set and all others 0."""
        assert 0 <= value < 1 << self.width
        return value << self.bit


@dataclass(frozen=True)
class Register:
    """One register of `size` bytes."""

    offset: int
    size: int
    fields: dict[str, Field]

    def unpack(self, word: int) -> dict[str, int]:
        return {name: field.get(word) for name, field in self.fields.items()}

    def pack(self, **values: int) -> int:
        return sum(self.fields[name].put(value) for name, value in values.items())


@dataclass(frozen=True)
class Area:
    """A frame or a counter: element i has `size` bytes at FRAMES + `offset` + i * STRIDE."""

    offset: int
    length: int
    size: int

    def at(self, i: int) -> int:
        """Offset of element i."""
        assert 0 <= i < self.length
        return self.offset + i * STRIDE

    @property
    def slot(self) -> int:
        return self.offset // STRIDE

    @property
    def lane(self) -> int:
        return self.offset % STRIDE
