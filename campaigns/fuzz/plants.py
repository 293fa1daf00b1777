# SPDX-License-Identifier: Apache-2.0
"""Planted bugs: the fuzzer must find them, otherwise a run without findings proves nothing.

Each bug is one change of a source file, made in a copy; `make fuzz-plants` counts the frames until it is
found.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from regs.dialects import DEFAULT, DIALECTS
from rtl.sources import ROOT, card_files, configurations
from sim.harness.library import Target

FOLDER = ROOT / "build/fuzz/plants"
CONFIGS = ROOT / "configs.toml"


class PlantError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Plant:
    """A bug: `old` becomes `new` in a file, or the card is built with other parameters or options."""

    name: str
    rules: tuple[str, ...]
    file: str = ""
    old: str = ""
    new: str = ""
    parameters: tuple[tuple[str, int], ...] = ()
    defines: str = ""
    description: str = ""  # rule and mistake, for the report

    @property
    def firmware(self) -> bool:
        return bool(self.defines) or self.file.startswith("sw/")

    def target(self) -> Target:
        """The card with this bug."""
        if self.firmware:
            return Target(images=self._firmware())
        if not self.file:
            return Target(parameters=self.parameters)
        folder = FOLDER / self.name
        folder.mkdir(parents=True, exist_ok=True)
        changed = folder / Path(self.file).name
        changed.write_text(self._changed())
        sources = [changed if path == ROOT / self.file else path for path in card_files()]
        return Target(sources=tuple(sources))

    def _changed(self) -> str:
        text = (ROOT / self.file).read_text()
        if text.count(self.old) != 1:
            raise PlantError(
                f"plant {self.name}: {text.count(self.old)} places in {self.file} instead of one"
            )
        return text.replace(self.old, self.new)

    def _firmware(self) -> Path:
        folder = FOLDER / self.name
        shutil.rmtree(folder, ignore_errors=True)
        for name in ("sw", "regs"):
            shutil.copytree(ROOT / name, folder / name)
        # The changed firmware needs to fit only the standard card.
        sizes = {entry["memory_bytes"] for entry in configurations().values()}
        roomy = re.sub(r"(?m)^memory_bytes = .*", f"memory_bytes = {max(sizes)}", CONFIGS.read_text())
        (folder / CONFIGS.name).write_text(roomy)
        if self.file:
            (folder / self.file).write_text(self._changed())
        dialects = [f"build/{dialect}/firmware.hex" for dialect in DIALECTS if dialect != DEFAULT]
        command = ["make", "--silent", "-f", "sw/firmware.mk", "SETUP=", "build/firmware.hex", *dialects]
        done = subprocess.run(
            [*command, f"FIRMWARE_DEFINES={self.defines}"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise PlantError(f"plant {self.name}: {done.stderr[-2000:]}")
        return folder / "build"


PLANTS = (
    Plant(
        "lenient-t15",
        ("FRAME-3",),
        parameters=(("STRICT_T15", 0),),
        description="FRAME-3: built with STRICT_T15 = 0",
    ),
    Plant(
        "reply-into-traffic",
        ("FRAME-7",),
        "rtl/gate/request_state.v",
        "else if (start_seen) state <= S_HEARD;",
        "",
        description="FRAME-7: the gate no longer drops a reply after a newer character",
    ),
    Plant(
        "address-of-a-revoked",
        ("FRAME-3",),
        "rtl/rtu_rx.v",
        "if (spoilt) next_state = STRICT_T15 ? S_WAIT : S_RECEIVE;",
        "if (byte_valid) next_state = S_SUSPECT;",
        description="FRAME-3: a new frame may begin after a revoked one",
    ),
    Plant(
        "no-new-address",
        ("FRAME-2",),
        "rtl/rtu_rx.v",
        "else if (short_reached && STRICT_T15) next_state = S_SUSPECT;",
        "else if (short_reached) next_state = S_WAIT;",
        description="FRAME-2: the bytes after an incomplete frame are dropped",
    ),
    Plant(
        "parity-ignored",
        ("FRAME-4",),
        "rtl/network_port.v",
        "(rx_parity_error),\n      .byte_framing_error(rx_framing_error),\n      .line_start",
        "(1'b0),\n      .byte_framing_error(rx_framing_error),\n      .line_start",
        description="FRAME-4: a parity error is ignored",
    ),
    Plant(
        "stop-bit-ignored",
        ("FRAME-4",),
        "rtl/network_port.v",
        ".byte_framing_error(rx_framing_error),\n      .line_start",
        ".byte_framing_error(1'b0),\n      .line_start",
        description="FRAME-4: a missing stop bit is ignored",
    ),
    Plant(
        "crc-ignored",
        ("FRAME-4",),
        "rtl/rtu_rx.v",
        "crc_good && clean",
        "clean",
        description="FRAME-4: the CRC is not checked",
    ),
    Plant(
        "length-257",
        ("FRAME-5",),
        "rtl/rtu_rx.v",
        "if (length[8]) overrun <= 1'b1;",
        "if (1'b0) overrun <= 1'b1;",
        description="FRAME-5: no end at 256",
    ),
    Plant(
        "t35-early",
        ("FRAME-1",),
        "rtl/silence_timer.v",
        "wire half_over = counting && ticks == half_end;",
        "wire half_over = counting && ticks == half_end - 2'd2;",
        description="FRAME-1: each half character is two ticks short",
    ),
    Plant(
        "half-a-glitch",
        ("LINE-5",),
        "rtl/glitch_filter.v",
        "ones >= 4'd5",
        "ones >= 4'd8",
        description="LINE-5: the filter wants eight of nine samples",
    ),
    Plant(
        "pulse-restarts-silence",
        ("LINE-5",),
        "rtl/network_port.v",
        ".restart(byte_valid),",
        ".restart(byte_valid || !synced),",
        description="LINE-5: a pulse in a silence restarts its count",
    ),
    Plant(
        "pulse-drops-reply",
        ("LINE-5",),
        "rtl/network_port.v",
        "assign start_seen = uart_start;",
        "assign start_seen = uart_start || !synced;",
        description="LINE-5: a pulse counts as a start bit and drops the reply",
    ),
    Plant(
        "drive-gap-forgiven",
        ("FC-8",),
        "rtl/drive_port.v",
        ".long_reached(long_reached),\n      // frame memory",
        ".long_reached(1'b0),\n      // frame memory",
        description="FC-8: a reply may pause",
    ),
    Plant(
        "slow-telegram-forgiven",
        ("FC-8",),
        "rtl/fc_rx.v",
        "(!check_good || ahead < 10'sd0)",
        "(!check_good)",
        description="FC-8: a slow reply is accepted",
    ),
    Plant(
        "bcc-ignored",
        ("FC-8",),
        "rtl/fc_rx.v",
        "(!check_good || ahead < 10'sd0)",
        "(ahead < 10'sd0)",
        description="FC-8: the BCC is not checked",
    ),
    Plant(
        "adr-ignored",
        (
            "FC-2",
            "FC-8",
        ),
        "rtl/fc_rx.v",
        "(state == S_ADR && byte_data != adr) ||",
        "",
        description="FC-2, FC-8: the address of a reply is not checked",
    ),
    Plant(
        "no-pause",
        ("FC-8",),
        "rtl/drive_port.v",
        "PAUSE_TICKS + 12'd4",
        "PAUSE_TICKS / 12'd4",
        description="FC-8: no two characters before a telegram",
    ),
    Plant(
        "no-repeat",
        ("FC-9",),
        "sw/src/exchange.c",
        "if (g->repeated || orders_wait(g)) {",
        "if (1) {",
        description="FC-9: no repeat",
    ),
    Plant(
        "command-in-a-parameter",
        ("SAFE-1",),
        "sw/src/telegram.c",
        "    return finish(txn, at, 0, 0);",
        "    return finish(txn, at, 0x047C, 0);",
        description="SAFE-1: every parameter telegram starts the motor; the gate takes bit 10 away",
    ),
    Plant(
        "endless-repeat",
        ("FC-9",),
        "sw/src/orders.c",
        "g->repeated = true;",
        "g->repeated = false;",
        description="FC-9: repeats without end",
    ),
    Plant(
        "other-wait",
        ("FC-9",),
        "sw/include/ticks.h",
        "(tens << 3) + (tens << 2)",
        "(tens << 3)",
        description="FC-9: 8 instead of 12 in the length of a wait",
    ),
    Plant(
        "any-pnu",
        ("FC-8",),
        "sw/src/translate.c",
        "(word_at(data) & 0x0FFF) != txn->pnu",
        "0",
        description="FC-8: a reply with another PNU is accepted",
    ),
    Plant(
        "newest-not-served",
        ("FRAME-7",),
        "sw/src/request.c",
        "    if (txn != g->newest)\n        return;\n",
        "",
        description="FRAME-7: an older reply takes the place of the newer one",
    ),
    Plant(
        "one-waiting-place",
        ("FRAME-7",),
        "sw/src/orders.c",
        "waiting[0] && waiting[0]->broadcast == g->newest->broadcast",
        "waiting[0]",
        description="FRAME-7: a write to all and one to the card take each other's place",
    ),
    Plant(
        "newest-leaves-first",
        ("FRAME-7",),
        "sw/src/orders.c",
        "        waiting[1] = g->newest;\n    else\n        waiting[0] = g->newest;",
        "        waiting[1] = waiting[0];\n    waiting[0] = g->newest;",
        description="FRAME-7: of two waiting writes the newer one leaves first",
    ),
    Plant(
        "wrong-order",
        ("EXC",),
        "sw/src/translate.c",
        "    if (!quantity_fits(",
        "    if (txn->address >> 15) return EXCEPTION + TRAITS.bad_address;\n    if (!quantity_fits(",
        description="EXC: address before quantity",
    ),
    Plant(
        "changed-before-commit",
        ("FRAME-6",),
        "sw/src/request.c",
        "    g->state = REQUEST_PREPARED;\n",
        "    g->state = REQUEST_PREPARED;\n    g->translator.settings.word[LOCAL_IND] = 0;\n",
        description="FRAME-6: a register changes with the candidate",
    ),
    Plant(
        "cut-value",
        ("MAP-7",),
        "sw/src/registers.c",
        "high == 0xFFFF && low >= 0x8000",
        "high == 0xFFFF",
        description="MAP-7: a value below -32768 is cut, not refused",
    ),
    Plant(
        "short-adr",
        ("FC-2",),
        defines="-DADR_SHORT=1",
        description="FC-2: a firmware built with another option",
    ),
    Plant(
        "status-asked",
        ("MAP-1",),
        "sw/include/options.h",
        "#define STATUS_REFRESH (DIALECT != DIALECT_CARD)",
        "#define STATUS_REFRESH 1",
        description="MAP-1: a firmware built with another option",
    ),
)


def named(name: str) -> Plant:
    for plant in PLANTS:
        if plant.name == name:
            return plant
    raise PlantError(f"no plant '{name}'; there are {', '.join(plant.name for plant in PLANTS)}")
