# SPDX-License-Identifier: Apache-2.0
"""Cells of the parts of a card: which modules each part has, how they are counted, and their targets."""

from __future__ import annotations

from collections.abc import Iterator

from constraints import flow
from rtl.sources import ROOT, card_files, configurations, rtl_files

# Modules that stay; the ports of all others become pins. A part is packed to count its cells, but not routed.
PORT = {"network_port", "drive_port", "sync_2ff", "glitch_filter", "uart", "silence_timer", "rs485_dir"}
PORT |= {"guarded_bit", "guarded_half", "sparse_state", "card_tables", "crc16_modbus", "rtu_rx", "rtu_tx"}
PORT |= {"bcc", "fc_rx", "fc_tx", "baud_base", "baud_divider"}
MAILBOX = {"mailbox", "mailbox_regs", "bus_arbiter", "guarded_bit", "guarded_half"}
MAILBOX |= {"commit_gate", "request_state", "licences", "reply_slot", "telegram_slot", "master_loss"}
OTHERS = {"reset_sync", "switch_sampler", "card_time", "supervisor", "driver_limit"}
CORE = {"soft_core"}
MEMORY = {"firmware_ram", "ram_bank", "ram_lane", "word_parity"}
WHOLE = PORT | MAILBOX | OTHERS | CORE | MEMORY
FRONT_END = "**front end**: both ports, framing and mailbox"
# Limits of its cells in either flow: fewer than the smallest slave with one port, no parity and no t1.5. That
# one takes 1030 and 1010 (docs/guide/integration.md).
TARGETS = {"machxo2": 1029, "ice40": 1009}
# Label, configuration, modules that stay.
PARTS = [
    ("UART of one port with its bit clock", "tiny", {"network_port", "uart", "baud_base", "baud_divider"}),
    ("network port", "tiny", PORT - {"drive_port"}),
    ("drive port", "tiny", PORT - {"network_port"}),
    ("mailbox", "tiny", MAILBOX),
    (FRONT_END, "tiny", PORT | MAILBOX),
    ("switches, reset, time, supervisor", "tiny", OTHERS),
    ("soft core of `tiny` (SERV)", "tiny", CORE),
    ("firmware memory of `tiny`, 6 KiB", "tiny", MEMORY),
    ("**whole card**, `tiny`", "tiny", WHOLE),
    ("soft core of `standard` (PicoRV32)", "standard", CORE),
    ("firmware memory of `standard`, 8 KiB", "standard", MEMORY),
    ("**whole card**, `standard`", "standard", WHOLE),
]
# Devices for counting parts. The packages are large, because a part alone has many pins.
COUNTED_ON = {
    "machxo2": ("xo2", ["--device", "LCMXO3LF-6900C-5BG400C"]),
    "ice40": ("hx", ["--hx8k", "--package", "ct256", "--pcf-allow-unconstrained"]),
}
# Yosys's default flow, and the flow used here.
FLOWS = ("plain", "ours")
PLAIN = {
    "machxo2": "synth_lattice -family {device} -top {top}",
    "ice40": "synth_ice40 -device {device} -top {top}",
}


def selection(modules: set[str], kind: str = "") -> str:
    """Yosys patterns for modules with any parameters."""
    return " ".join(
        f"{kind}{pattern}"
        for module in sorted(modules)
        for pattern in (module, f"$paramod\\{module}\\*", f"$paramod$*\\{module}")
    )


def counts() -> Iterator[tuple[str, str, str, str, set[str]]]:
    """What count_part takes, for each cell of the table."""
    for label, config, stay in PARTS:
        for family in COUNTED_ON:
            yield from ((label, family, mapper, config, stay) for mapper in FLOWS)


def rows(found: dict) -> dict[str, dict]:
    """The counts by label, family and flow, as a table."""
    return {
        label: {family: {mapper: found[label, family, mapper] for mapper in FLOWS} for family in COUNTED_ON}
        for label, *_ in PARTS
    }


def count_part(label: str, family: str, mapper: str, config: str, stay: set[str]) -> dict[str, int]:
    """Cells, flip-flops and block RAMs of a part."""
    modules = {path.stem for path in rtl_files()} - {"rtu2fc"}
    if not stay <= modules:
        raise flow.SynthError(f"no such module: {', '.join(sorted(stay - modules))}")
    gone = modules - stay
    number = [one for one, *_ in PARTS].index(label)
    folder = flow.BUILD / "parts" / f"{number}-{family}-{mapper}"
    folder.mkdir(parents=True, exist_ok=True)
    relative = folder.relative_to(ROOT)
    entry = configurations()[config]
    (folder / "pattern.hex").write_text(flow.pattern(entry["memory_bytes"] // 4))
    device, options = COUNTED_ON[family]
    commands = flow.mapping(family, device, "rtu2fc", "-nocarry") if mapper == "ours" else None
    cut = ""
    if gone:
        cut = f"""blackbox {selection(gone)}
proc
flatten
expose -evert {selection(gone, "rtu2fc/t:")}
delete {selection(gone)}
opt_clean"""
    script = f"""
read_verilog -defer {" ".join(flow.sandboxed(path) for path in card_files(config))}
chparam -set FIRMWARE_HEX "{relative}/pattern.hex" rtu2fc
hierarchy -top rtu2fc
{flow.OPEN_HALVES}
{cut}
{commands or PLAIN[family].format(device=device, top="rtu2fc")}
write_json {relative}/part.json
"""
    (folder / "part.json").unlink(missing_ok=True)
    flow.yosys(folder, "part", script)
    flow.without_loose_inputs(folder / "part.json")
    command = [f"yowasp-nextpnr-{family}", *options, "--json", f"{relative}/part.json", "--pack-only"]
    flow.tool(command, folder / "part.nextpnr.log")
    used = flow.utilisation((folder / "part.nextpnr.log").read_text())
    return {"cells": flow.cells(used, family), "brams": used.get(flow.BRAMS[family], 0)}


def over_target(front_end: dict) -> list[str]:
    return [
        f"front end: {count['cells']} cells on {family}, {name} flow, but {TARGETS[family]} are its target"
        for family, flows in front_end.items()
        for name, count in flows.items()
        if count["cells"] > TARGETS[family]
    ]


def part_row(label: str, row: dict) -> str:
    counts = [row[family][mapper]["cells"] for family in COUNTED_ON for mapper in FLOWS]
    brams = [row[family]["ours"]["brams"] for family in COUNTED_ON]
    return f"| {label} | " + " | ".join(map(str, counts + brams)) + " |"
