# SPDX-License-Identifier: Apache-2.0
"""The vectors of a module by the names of their fields: `fields.request_commit` is one bit of `dut.request`.

The names are those of regs/card.toml and regs/mailbox.rdl, as in the Verilog.
"""

from __future__ import annotations

import tomllib

from regs.generated.mailbox import REGISTERS
from tb.lib.runner import ROOT

VECTORS = tomllib.loads((ROOT / "regs/card.toml").read_text())["vectors"]


class _Field:
    """One field of a vector. A write keeps the other fields as they were written last."""

    def __init__(self, vector: _Vector, bit: int, width: int):
        self._vector, self._bit, self._mask = vector, bit, (1 << width) - 1

    @property
    def value(self) -> int:
        return int(self._vector.handle.value) >> self._bit & self._mask

    @value.setter
    def value(self, value: int) -> None:
        assert 0 <= value <= self._mask
        vector = self._vector
        vector.written = vector.written & ~(self._mask << self._bit) | value << self._bit
        vector.handle.value = vector.written


class _Vector:
    def __init__(self, handle):
        self.handle = handle
        self.written = 0  # a simulator shows a written value later


class Fields:
    """The pins of `dut`, and each field of `vectors` as `<pin>_<field>`.

    `vectors` maps a pin to a vector of regs/card.toml or a register of regs/mailbox.rdl.
    """

    def __init__(self, dut, **vectors: str):
        self._dut = dut
        self.fields: list[str] = []
        for pin, name in vectors.items():
            vector, width = _Vector(getattr(dut, pin)), len(getattr(dut, pin))
            for field, (bit, bits) in _places(name).items():
                if bit < width:  # a pin may carry the low fields of a register
                    self.fields.append(f"{pin}_{field}")
                    setattr(self, self.fields[-1], _Field(vector, bit, bits))

    def __getattr__(self, name: str):
        return getattr(self._dut, name)


def _places(name: str) -> dict[str, tuple[int, int]]:
    """Field to its lowest bit and width. The fields of a vector lie in the order of the file."""
    if name in REGISTERS:
        return {field: (place.bit, place.width) for field, place in REGISTERS[name].fields.items()}
    widths = list(VECTORS[name].values())
    return {field: (sum(widths[:n]), width) for n, (field, width) in enumerate(VECTORS[name].items())}
