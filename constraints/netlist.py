# SPDX-License-Identifier: Apache-2.0
"""Checks of a netlist from Yosys: one clock, and every input goes to one flip-flop first."""

from __future__ import annotations

# The families' flip-flops.
MAPPED = {
    "ice40": tuple(f"SB_DFF{kind}" for kind in ("", "E", "R", "S", "SR", "SS", "ER", "ES", "ESR", "ESS")),
    "machxo2": ("TRELLIS_FF",),
    "ecp5": ("TRELLIS_FF",),
    "gowin": tuple(f"DFF{kind}" for kind in ("", "E", "R", "S", "RE", "SE", "C", "P", "CE", "PE")),
}
# Clock ports of flip-flops and memories; those of other cells are called CLK.
CLOCK_PORTS = {
    "SB_DFF": ("C",),
    "SB_RAM40_4K": ("RCLK", "WCLK"),
    "DP8KC": ("CLKA", "CLKB"),
    "DP16KD": ("CLKA", "CLKB"),
    "TRELLIS_DPR16X4": ("WCK",),
}


def clocks(module: dict) -> set[int | str]:
    """Nets at the clock inputs of all flip-flops and memories."""
    found: set[int | str] = set()
    for cell in module["cells"].values():
        # Falling-edge variants too.
        kind = "SB_DFF" if cell["type"].startswith("SB_DFF") else cell["type"]
        for port, bits in cell["connections"].items():
            if port in CLOCK_PORTS.get(kind, ("CLK",)):
                found |= set(bits)
    # A memory port without a clock has x there.
    return found - {"x"}


def loose_inputs(module: dict, flip_flops: tuple[str, ...]) -> list[str]:
    """Input bits that are not the data of exactly one flip-flop, directly or through a cell of their own."""
    users: dict[int | str, list[tuple[str, str, dict]]] = {}
    for cell in module["cells"].values():
        for port, bits in cell["connections"].items():
            if cell["port_directions"][port] == "input":
                for bit in bits:
                    users.setdefault(bit, []).append((cell["type"], port, cell))
    wrong = []
    for name, port in module["ports"].items():
        if port["direction"] != "input" or name == "clk":
            continue
        for number, bit in enumerate(port["bits"]):
            used = users.get(bit, [])
            # An input buffer, an inverter.
            while len(used) == 1 and (bit := only_output(used[0][2], bit)) is not None:
                used = users.get(bit, [])
            if len(used) != 1 or used[0][1] not in ("D", "DI") or used[0][0] not in flip_flops:
                wrong.append(f"{name}[{number}]: {[use[:2] for use in used]}")
    return wrong


def only_output(cell: dict, bit: int | str) -> int | None:
    """Output net of an input buffer, or of a look-up table whose only input is `bit`: an inverter."""
    if cell["type"] not in ("SB_LUT4", "LUT4", "LUT1", "IBUF"):
        return None
    nets = {way: [] for way in ("input", "output")}
    for port, bits in cell["connections"].items():
        nets[cell["port_directions"][port]] += [net for net in bits if isinstance(net, int)]
    return nets["output"][0] if nets["input"] == [bit] else None


def crossings(module: dict, family: str) -> list[str]:
    """Errors of clock and inputs in a board's netlist of its family's cells."""
    wrong = [f"input {said}" for said in loose_inputs(module, MAPPED[family])]
    pin = set(module["ports"]["clk"]["bits"])
    buffered = {
        net
        for cell in module["cells"].values()
        if cell["type"] == "IBUF" and set(cell["connections"]["I"]) <= pin
        for net in cell["connections"]["O"]
    }
    return wrong + [f"a clock that is not the pin clk: net {net}" for net in clocks(module) - pin - buffered]
