# SPDX-License-Identifier: Apache-2.0
"""Draws build/diagrams/*.svg: timing diagrams of runs of the card, by WaveDrom.

    python -m tools.diagrams [NAME ...]

Each diagram is made from a run of the whole card with its firmware (tb/lib/fast_card.py). The recording holds
every edge on the pins and some strobes inside; the diagram is a window on it. Levels, frames, arrows and all
figures come from the recording; only the texts are written here. The runs are deterministic, so the same
sources give the same pictures. The WaveJSON, for WaveDrom's editor, goes to build/diagrams, too.

Times are in ps since power-up. Exit code 2 for an unknown name.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import matplotlib
from fontTools.ttLib import TTFont
from wavedrom.waveform import WaveDrom

from regs.generated.card_tables import CHARACTER_BITS
from rtl.command import Parser, run_main
from rtl.sources import ROOT
from sim.view.wave_file import WaveFile
from tb.agents import rtu
from tb.agents.edges import Trace
from tb.agents.uart import Format
from tb.lib.card import MS, baud_switches
from tb.lib.fast_card import SHOWN_SEED, SLOW_HZ, FastCard
from tb.model import fc_telegram
from tb.model.vlt_drive import VltDrive

DIAGRAMS = ROOT / "build/diagrams"
# A white picture glares on a dark page. `svg:root` leaves the page alone into which a picture is copied.
DARK = "@media(prefers-color-scheme:dark){svg:root{filter:invert(.9) hue-rotate(180deg)}}"
LINE = Format.named(9600, "8E1")
BIT = LINE.bit_ps
LOOPBACK = "111001111"
BOOTED_MS = 25.0
REGISTER = rtu.build(1, rtu.read_registers(2, 1))  # answered by the card itself
START = rtu.build(1, bytes.fromhex("0F 00 00 00 20 04 7C 04 99 19"))
BROADCAST = rtu.build(0, START[1:-2])
# Fill of a block: WaveDrom's digit, and its meaning here.
FROM_OUTSIDE, FROM_CARD, PLAIN = "3", "4", "5"
COLOURS = {"3": "#cfe5fb", "4": "#ffe3b0", "5": "#eeeeee"}
FILL_CLASS = {"3": "s8", "4": "s9", "5": "s10"}  # classes of WaveDrom's skin
GRID = 2  # bricks between two dotted lines of WaveDrom
BRICK = 10  # pixels, in WaveDrom's narrow skin
LABEL_PX, NAME_PX = 12, 14
STEP_MS = 0.625  # of the diagrams of both lines
IN_BITS, IN_MS = ("bit", BIT), ("ms", MS)
CLOCK = f"card at {SLOW_HZ['standard'] / 1e6:g} MHz"  # slower than a real one: its firmware takes longer
Edges = list[tuple[float, int]]


def bits(ps: float) -> str:
    return f"{ps / BIT:.2f} bits"


def ms(ps: float) -> str:
    return f"{ps / MS:.2f} ms"


def hexadecimal(data: bytes) -> str:
    return data.hex(" ").upper()


@dataclass(frozen=True)
class Block:
    """A stretch of time with a text, such as a frame."""

    start: float
    end: float
    text: str
    fill: str = PLAIN
    data: bytes = b""


@dataclass
class Drawing:
    """A window on a recording, as WaveJSON: one brick of WaveDrom, 10 or 20 pixels, lasts `step`.

    unit: name and length of what the grid is given in.
    """

    title: str
    start: float
    end: float
    step: float
    unit: tuple[str, float] = IN_BITS
    foot: str = ""
    lanes: list = field(default_factory=list)
    edges: list[str] = field(default_factory=list)
    nodes: int = 0

    @property
    def bricks(self) -> int:
        return round((self.end - self.start) / self.step)

    @property
    def grid(self) -> str:
        name, length = self.unit
        share = GRID * self.step / length
        number = {0.25: "¼", 0.5: "½"}.get(share, f"{share:g}")
        return f"{number} {name}{'s' * (name == 'bit' and share > 1)}"

    def brick(self, when: float) -> int:
        return min(max(round((when - self.start) / self.step), 0), self.bricks)

    def group(self, name: str) -> None:
        self.lanes.append([name])

    def _lane(self, name: str, wave: str, **more: object) -> None:
        to = self.lanes[-1] if self.lanes and isinstance(self.lanes[-1], list) else self.lanes
        to.append({"name": name, "wave": wave, "period": 0.5, **more})

    def level(self, name: str, edges: Edges, idle: int = 0) -> None:
        """A pin, drawn from its edges; a pulse shorter than a brick gets one."""
        wave = ["01"[idle]] * self.bricks
        for at, level in edges:
            if at >= self.end:
                break
            first = self.brick(at)
            wave[first:] = ["01"[level]] * (self.bricks - first)
        for at, level in edges:
            if self.start <= at < self.end and (first := self.brick(at)) < self.bricks:
                wave[first] = "01"[level] if level != idle else wave[first]
        self._lane(name, "".join(c if i == 0 or c != wave[i - 1] else "." for i, c in enumerate(wave)))

    def blocks(self, name: str, blocks: list[Block], between: str = "1") -> None:
        """Frames, characters or bits, with their texts."""
        wave, data = [between] * self.bricks, []
        for number, block in enumerate(blocks):
            first, last = self.brick(block.start), self.brick(block.end)
            if first == last:
                continue
            wave[first:last] = [f"{block.fill}{number}"] * (last - first)
            data.append(block.text)
        starts = [i == 0 or mark != wave[i - 1] for i, mark in enumerate(wave)]
        packed = "".join(mark[0] if new else "." for mark, new in zip(wave, starts, strict=True))
        self._lane(name, packed, data=data)

    def arrows(self, *spans: tuple[float, float, str]) -> None:
        """A separate lane, so that no arrow crosses a signal. Long texts stand beside their arrow."""
        node = ["."] * (self.bricks + 1)

        def mark(at: int) -> str:
            if node[at] == ".":
                node[at] = chr(ord("A") + self.nodes)
                self.nodes += 1
            return node[at]

        for start, end, text in spans:
            first, last = self.brick(start), self.brick(end)
            room = wide_px(text) + 4 * BRICK
            if (last - first) * BRICK >= room:
                self.edges.append(f"{mark(first)}<->{mark(last)} {text}")
            else:
                self.edges.append(f"{mark(first)}<->{mark(last)}")
                beside = mark(last + round((wide_px(text) / 2 + BRICK) / BRICK))
                self.edges.append(f"{beside}-{beside} {text}")
        self.lanes.append({"name": "", "wave": "", "node": "".join(node), "period": 0.5})

    @property
    def json(self) -> dict:
        return {
            "head": {"text": f"{self.title}  (grid: {self.grid}; {CLOCK})"},
            "signal": self.lanes,
            "edge": self.edges,
            "foot": {"text": self.foot},
            "config": {"skin": "narrow"},
        }


# ---------------------------------------------------------------- WaveDrom

STYLE = """
text{{font-family:"DejaVu Sans",Verdana,sans-serif}}
text{{font-size:{label_px}px;fill:#111}}
text[fill],.info{{font-size:{name_px}px}}
.info,.label{{fill:#0b3d91}}
.s1,.s2{{fill:none;stroke:#222;stroke-width:1.2;stroke-linecap:round}}
{fills}
"""
XLINK = "http://www.w3.org/1999/xlink"
SVG = "http://www.w3.org/2000/svg"
TEXT, TSPAN = f"{{{SVG}}}text", f"{{{SVG}}}tspan"
PRESERVE = "{http://www.w3.org/XML/1998/namespace}space"


@cache
def dejavu() -> tuple[dict, dict, int]:
    face = TTFont(Path(matplotlib.get_data_path()) / "fonts/ttf/DejaVuSans.ttf")
    return face.getBestCmap(), face["hmtx"].metrics, face["head"].unitsPerEm


def wide_px(text: str, size: float = LABEL_PX) -> float:
    """The width in DejaVu Sans, and in Verdana."""
    glyphs, widths, em = dejavu()
    return sum(widths[glyphs[ord(letter)]][0] for letter in text) * size / em


def fitted(text: str, room: float, size: float = LABEL_PX) -> dict[str, str]:
    """Attributes that keep a text in its room: its width in every font, and a smaller size if needed."""
    share = min(1.0, room / wide_px(text, size))
    style = {"style": f"font-size:{share * size:.1f}px"} if share < 1 else {}
    return style | {"textLength": f"{wide_px(text, share * size):.1f}", "lengthAdjust": "spacingAndGlyphs"}


class Renderer(WaveDrom):
    """WaveDrom with larger labels, which keep their place in every font."""

    def text_width(self, string: str, size: int = 11) -> float:
        return wide_px(string, NAME_PX) + BRICK

    def render_label(self, p: dict, text: str):
        group = self.container.g(transform=f"translate({p.x},{p.y})")
        width = wide_px(text) + 8
        group.add(self.element.rect(insert=(-width / 2, -7), size=(width, 14), style="fill:#fff"))
        group.add(self.element.text(text, text_anchor="middle", y=[4], class_="label"))
        return group

    def render_lane_uses(self, val: list, g) -> None:
        """Centres each text in its block, no wider than the block; omits texts of very small blocks."""
        name, bricks, texts = val
        super().render_lane_uses([name, bricks, None], g)
        changes = [0, *(i for i, brick in enumerate(bricks or []) if i and "m" in brick), len(bricks or [])]
        blocks = [(at, to) for at, to in pairwise(changes) if at < to and re.search(r"v(-\d)+$", bricks[at])]
        for (at, to), text in zip(blocks, texts or [], strict=True):
            inside = at + ("m" in bricks[at])
            room = (to - inside) * BRICK
            if wide_px(text) > 1.3 * room:
                continue
            said = self.element.text(
                text, x=[inside * BRICK + room / 2], y=[self.lane.ym], text_anchor="middle"
            )
            said.update(fitted(text, room - 1))  # sizes are rounded
            g.add(said)


def svg(drawing: Drawing) -> str:
    """Renders with a white ground, this style, and only the used parts of the skin."""
    renderer = Renderer()
    rendered = renderer.render_waveform(0, drawing.json, []).tostring()
    ElementTree.register_namespace("", SVG)
    ElementTree.register_namespace("xlink", XLINK)
    root = ElementTree.fromstring(rendered)
    used = {use.get(f"{{{XLINK}}}href")[1:] for use in root.iter(f"{{{SVG}}}use")}
    for defs in root.iter(f"{{{SVG}}}defs"):
        for brick in defs.findall(f"{{{SVG}}}g"):
            if brick.get("id") not in used:
                defs.remove(brick)
    for text in root.iter(TEXT):
        # With preserved space, the indentation would become part of the text.
        text.attrib.pop(PRESERVE, None)
        for span in text.findall(TSPAN):
            text.text = span.text
            text.remove(span)
        caption = "fill" in text.attrib
        if caption:  # in the middle of the picture, not of its plot
            text.set("x", f"{float(root.get('width')) / 2 - renderer.lane.xg:.1f}")
        if text.text and "textLength" not in text.attrib:
            size = NAME_PX if caption or text.get("class") == "info" else LABEL_PX
            room = float(root.get("width")) - 2 * BRICK if caption else wide_px(text.text, size)
            text.attrib.update(fitted(text.text, room, size))
    fills = "\n".join(f".{FILL_CLASS[digit]}{{fill:{fill}}}" for digit, fill in COLOURS.items())
    style = STYLE.format(label_px=LABEL_PX, name_px=NAME_PX, fills=fills)
    next(root.iter(f"{{{SVG}}}style")).text = style
    ground = ElementTree.Element(f"{{{SVG}}}rect", width="100%", height="100%", fill="#fff")
    root.insert(0, ground)
    ElementTree.indent(root, " ")
    return for_dark_pages(ElementTree.tostring(root, encoding="unicode")) + "\n"


def for_dark_pages(picture: str) -> str:
    """With the style for them; a path is one line."""
    picture = re.sub(r' d="[^"]*"', lambda found: found[0].replace(" \n", " ").replace("\n", ""), picture)
    return re.sub(r"<style[^>]*>", lambda found: found[0] + DARK, picture, count=1)


# ---------------------------------------------------------------- reading a recording


class Recorded:
    """Signals on the pins during a run."""

    of_module = False

    def __init__(self, card: FastCard) -> None:
        self.edges: dict[str, Edges] = card.recorded_so_far()

    def pulses(self, name: str) -> list[tuple[float, float]]:
        """Rise and fall of each pulse."""
        found, rise = [], None
        for at, level in self.edges[name]:
            if level:
                rise = at
            elif rise is not None:
                found.append((rise, at))
                rise = None
        return found

    def after(self, name: str, when: float) -> float:
        """The next rise of a strobe."""
        return next(rise for rise, _ in self.pulses(name) if rise >= when)

    def lanes(self, drawing: Drawing, *names: str) -> None:
        """Pins and strobes; the names of the card's strobes are written as words."""
        for name in names:
            shown = (
                name if self.of_module or name.startswith(("modbus_", "drive_de")) else name.replace("_", " ")
            )
            drawing.level(shown, self.edges[name], idle=name.endswith(("rx", "tx")))

    def characters(self, pin: str, fill: str = PLAIN) -> list[Block]:
        """Characters on a pin."""
        heard = Trace(LINE, self.edges[pin]).characters
        return [Block(c.start_ps, c.end_ps, f"{c.byte:02X}", fill, bytes([c.byte])) for c in heard]

    def frames(self, pin: str, fill: str) -> list[Block]:
        """Characters without t1.5 of silence between them."""
        found: list[Block] = []
        for one in self.characters(pin):
            if found and one.start - found[-1].end < 1.5 * LINE.character_ps:
                before = found.pop()
                one = Block(before.start, one.end, "", data=before.data + one.data)
            found.append(Block(one.start, one.end, hexadecimal(one.data), fill, one.data))
        return found


class Run(FastCard):
    """The card after its start, with a drive in the state of the manual's examples."""

    def __init__(self, wave: Path | None = None) -> None:
        drive = VltDrive(example=True)
        switches = baud_switches(LINE.baud, "8E1")
        super().__init__(switches, form="8E1", drive=drive.telegram, wave=wave, seed=SHOWN_SEED)
        self.run(BOOTED_MS)

    def recorded_now(self, ms_more: float = 5.0) -> Recorded:
        self.run(ms_more)
        return Recorded(self)


class Port(Recorded):
    """The ports of one module of the card during a request, from a waveform; `clock`: length of a clock."""

    of_module = True

    def __init__(self, instance: str, request: bytes) -> None:
        with tempfile.TemporaryDirectory() as folder:
            wave = Path(folder) / "run.fst"
            with Run(wave) as card:
                card.request(request, timeout_ms=60)
                card.run(5)
            file = WaveFile(wave)
            # The waveform has two times a clock, in ns, and another beginning than the recording.
            self.clock = card.period_ps
            first = next(when for when, value in file.changes("modbus_de") if value == "1")
            begin = card.recorded["modbus_de"][0][0] - round(first * 1e9) * self.clock // 2
            self.values: dict[str, Edges] = {}
            for signal in (name for name in file.signals if name.rpartition(".")[0] == instance):
                changes = [
                    (begin + round(when * 1e9) * self.clock // 2, int(value))
                    for when, value in file.changes(signal)
                ]
                # Registers hold anything at power-up (SAFE-5).
                booted = BOOTED_MS * MS
                before = [value for at, value in changes if at <= booted]
                later = [change for change in changes if change[0] > booted]
                self.values[signal.rpartition(".")[2]] = [(booted, before[-1]), *later]
        self.edges = dict(self.values)

    def value(self, name: str, when: float) -> int:
        return next(value for at, value in reversed(self.values[name]) if at <= when)

    def accesses(self, kind: str) -> list[tuple[float, int, int]]:
        """End of the clock, place and byte of each access; the byte of a read comes in the next clock."""
        found = []
        for rise, fall in self.pulses(f"{kind}_ready"):
            if self.value(f"{kind}_valid", rise):
                late = self.clock if kind == "read" else 0
                found.append(
                    (fall, self.value(f"{kind}_addr", rise), self.value(f"{kind}_data", rise + late))
                )
        return found

    def memory(self, drawing: Drawing, kind: str, fill: str) -> None:
        """Each access of one kind, with its text until the next one."""
        self.lanes(drawing, f"{kind}_valid")
        long = 10.5 * BIT
        blocks = [
            Block(at, at + long, f"{place}: {byte:02X}h", fill) for at, place, byte in self.accesses(kind)
        ]
        drawing.blocks(f"{kind}, place: byte", blocks, between="0")


# ---------------------------------------------------------------- the diagrams

BIT_NAMES = ("start", *(f"b{i}" for i in range(8)), "parity", "stop")


def character() -> Drawing:
    """The first character that the card sends, with its driver."""
    with Run() as card:
        card.request(REGISTER)
        seen = card.recorded_now()
    first, second = seen.characters("modbus_tx")[:2]
    enabled = seen.pulses("modbus_de")[0][0]
    drawing = Drawing(
        f"A character: {first.text}h at {LINE.baud} bit/s, 8E1, as the card sends it",
        first.start - 2 * BIT,
        first.end + 2 * BIT,
        BIT / 4,
    )
    length = second.start - first.start
    seen.lanes(drawing, "modbus_de", "modbus_tx")
    names = [Block(first.start + i * BIT, first.start + (i + 1) * BIT, n) for i, n in enumerate(BIT_NAMES)]
    drawing.blocks("bit", [*names, Block(second.start, second.start + BIT, "start")])
    drawing.arrows((first.start, second.start, f"{bits(length)}, {ms(length)}"))
    value = first.data[0]
    sent = " ".join(str(value >> i & 1) for i in range(8))
    lead = bits(first.start - enabled)
    drawing.foot = f"Least bit first: {sent}, then even parity. Driver on {lead} before the start bit."
    return drawing


def request_end(seen: Recorded, data: bytes, pin: str = "modbus_rx") -> float:
    return next(frame.end for frame in seen.frames(pin, PLAIN) if frame.data.startswith(data))


def gate_lanes(drawing: Drawing, seen: Recorded) -> None:
    drawing.group("network line")
    seen.lanes(drawing, "modbus_rx")
    drawing.blocks("characters", seen.characters("modbus_rx", FROM_OUTSIDE))
    seen.lanes(drawing, "modbus_de", "modbus_tx")
    drawing.group("commit gate")
    seen.lanes(drawing, "candidate", "commit", "revoke", "reply_queued")


def commit() -> Drawing:
    """A request that the card answers without the drive: candidate, t3.5 and the reply's first characters."""
    with Run() as card:
        card.request(REGISTER)
        seen = card.recorded_now()
    end = request_end(seen, REGISTER)
    candidate, committed = seen.after("candidate", end), seen.after("commit", end)
    queued = seen.after("reply_queued", end)
    reply = seen.characters("modbus_tx")[0].start
    drawing = Drawing(
        "Prepare early, commit late: the end of a request and its reply",
        end - 6 * BIT,
        reply + 5 * BIT,
        BIT / 2,
    )
    enabled = seen.pulses("modbus_de")[0][0]
    gate_lanes(drawing, seen)
    drawing.arrows((end, candidate, f"half a character: {bits(candidate - end)}"))
    drawing.arrows((end, committed, f"t3.5: {bits(committed - end)}"))
    out = bits(reply - end - 3.5 * CHARACTER_BITS * BIT)
    drawing.foot = (
        f"The reply is ready {ms(queued - candidate)} after the candidate (firmware at 2 MHz)."
        f" It leaves {out} after t3.5, its driver {bits(reply - enabled)} earlier."
    )
    return drawing


def revoke() -> Drawing:
    """The same request, with another character three characters later, when its reply is prepared."""
    with Run() as card:
        card.modbus.send(REGISTER, 1.05 * 3.5 * LINE.character_ps)
        card.modbus.send(b"\x55", 3 * LINE.character_ps)
        card.run(40)
        seen = card.recorded_now()
    stray = next(c for c in seen.characters("modbus_rx") if c.data == b"\x55")
    end = request_end(seen, REGISTER)
    candidate, revoked = seen.after("candidate", end), seen.after("revoke", end)
    drawing = Drawing(
        "Revoke: a character between t1.5 and t3.5 takes the request back",
        end - 14 * BIT,
        end + 52 * BIT,
        BIT,
    )
    assert candidate < seen.after("reply_queued", end) < revoked
    assert not any(end <= rise <= end + 100 * BIT for rise, _ in seen.pulses("commit"))
    assert not seen.pulses("modbus_de")
    gate_lanes(drawing, seen)
    drawing.arrows((end, candidate, f"half a character: {bits(candidate - end)}"))
    drawing.arrows((end, stray.start, f"next character: {bits(stray.start - end)}"))
    seen_after = bits(revoked - stray.start)
    drawing.foot = f"Revoked {seen_after} after the start edge. Nothing was sent, nothing was changed."
    return drawing


def transaction(title: str, request: bytes, answered: bool = True) -> tuple[Drawing, list[Block]]:
    """A request that goes to the drive, on both lines from the first start bit to the last stop bit."""
    with Run() as card:
        card.request(request, timeout_ms=60)
        seen = card.recorded_now(8.0)
    asked = seen.frames("modbus_rx", FROM_OUTSIDE)
    replies = seen.frames("modbus_tx", FROM_CARD)
    telegrams = seen.frames("drive_tx", FROM_CARD)
    answers = seen.frames("drive_rx", FROM_OUTSIDE)
    assert len(asked) == len(telegrams) == 1 and len(replies) == answered, title
    last = max(frame.end for frame in (*asked, *replies, *telegrams, *answers))
    drawing = Drawing(title, asked[0].start - MS, last + 1.5 * MS, STEP_MS * MS, IN_MS)
    drawing.group("network line")
    drawing.blocks("master", asked)
    drawing.blocks("card", replies)
    seen.lanes(drawing, "modbus_de")
    drawing.group("drive line")
    drawing.blocks("card", telegrams)
    drawing.blocks("drive", answers)
    seen.lanes(drawing, "drive_de")
    drawing.group("commit gate")
    seen.lanes(drawing, "candidate", "commit", "drive_candidate", "drive_good")
    after = bits(telegrams[0].start - asked[0].end)
    # At this clock the telegram of a parameter is not ready at t3.5 (docs/guide/timing.md).
    late = telegrams[0].start - asked[0].end > (3.5 * CHARACTER_BITS + 2) * BIT
    spans = [(asked[0].end, telegrams[0].start, f"t3.5, {'firmware' if late else 'driver'}: {after}")]
    if answers:
        sent, heard = telegrams[0].end, answers[0].start
        spans.append((sent, heard, f"drive's delay: {bits(heard - sent)}"))
    drawing.arrows(*spans)
    if replies:
        turnaround = ms(replies[0].start - asked[0].end)
        drawing.arrows((asked[0].end, replies[0].start, f"turnaround {turnaround}"))
    return drawing, [*asked, *telegrams, *answers, *replies]


def start_motor() -> Drawing:
    drawing, (_, told, answer, reply) = transaction("Start, 40 % speed: one request on both lines", START)
    drawing.foot = (
        f"To the drive: {fc_telegram.describe(told.data)}."
        f" Its answer: {fc_telegram.describe(answer.data, reply=True)}."
        f" The reply leaves {bits(reply.start - answer.end)} after it."
    )
    return drawing


def refusal() -> Drawing:
    request = rtu.build(1, rtu.write_register(10 * 514 - 1, 1))
    drawing, (_, _, answer, reply) = transaction("Exception: a write that the drive refuses", request)
    said = fc_telegram.describe(answer.data, reply=True).split(";")[0]
    after = bits(reply.start - answer.end)
    drawing.foot = (
        f"The drive: {said}. The card: exception {reply.data[2]}, {after} after the drive's answer."
    )
    return drawing


def broadcast() -> Drawing:
    drawing, (_, told) = transaction("Broadcast: a telegram to all, and no reply", BROADCAST, answered=False)
    drawing.foot = f"ADR {told.data[2]:02X}h: {fc_telegram.describe(told.data)}. Both lines stay silent then."
    return drawing


def loop_back() -> Drawing:
    """Both ports wired to each other: their telegrams, and the verdict."""
    with FastCard(LOOPBACK, wired=1, seed=SHOWN_SEED) as card:
        card.run(2100)
        seen, shown = Recorded(card), card.shown
    telegram, frame = seen.frames("drive_tx", FROM_CARD)[0], seen.frames("modbus_tx", FROM_CARD)[0]
    drawing = Drawing(
        "Loop-back test: each port sends, the other listens",
        telegram.start - 2 * MS,
        frame.end + 2 * MS,
        STEP_MS * MS,
        IN_MS,
    )
    drawing.group("drive port")
    drawing.blocks("sends", [telegram])
    drawing.blocks("hears", seen.frames("drive_rx", FROM_OUTSIDE))
    seen.lanes(drawing, "drive_de")
    drawing.group("network port")
    drawing.blocks("sends", [frame])
    drawing.blocks("hears", seen.frames("modbus_rx", FROM_OUTSIDE))
    seen.lanes(drawing, "modbus_de")
    drawing.arrows((telegram.end, frame.start, ms(frame.start - telegram.end)))
    verdicts = {led: history[-1] for led, history in shown.items()}
    (verdict,) = {one.colour for one in verdicts.values()}
    when = f"{max(one.since_ps for one in verdicts.values()) / MS:.0f} ms"
    drawing.foot = f"First bit {ms(telegram.start)} after power-up. Both LEDs {verdict} from {when} on."
    return drawing


def network_port() -> Drawing:
    """The ports of network_port at the end of a request and the beginning of its reply."""
    seen = Port("network_i", REGISTER)
    end = request_end(seen, REGISTER, "rx")
    reply = seen.characters("tx", FROM_CARD)
    drawing = Drawing(
        "network_port: the end of a request and its reply", end - 25 * BIT, reply[1].end + 3 * BIT, BIT
    )
    drawing.group("pins")
    drawing.blocks("rx", seen.characters("rx", FROM_OUTSIDE))
    seen.lanes(drawing, "de")
    drawing.blocks("tx", reply)
    drawing.group("memory")
    seen.memory(drawing, "write", FROM_OUTSIDE)
    seen.memory(drawing, "read", FROM_CARD)
    drawing.group("request")
    seen.lanes(drawing, "candidate", "commit", "silent")
    drawing.group("control")
    seen.lanes(drawing, "start_seen", "quiet", "reply_start", "sending")
    candidate, committed = (seen.after(name, end) for name in ("candidate", "commit"))
    started = seen.after("reply_start", end)
    drawing.arrows((end, candidate, f"half a character: {bits(candidate - end)}"))
    drawing.arrows((end, committed, f"t3.5: {bits(committed - end)}"))
    drawing.foot = f"The first start bit leaves {bits(reply[0].start - started)} after reply_start."
    return drawing


def handshake(kind: str, title: str, filling: str) -> Drawing:
    """The second access of one kind that network_port makes for a request, clock by clock."""
    seen = Port("network_i", REGISTER)
    begin = seen.characters("rx")[0].start
    end, place, byte = [access for access in seen.accesses(kind) if access[0] > begin][1]
    rise = max(rise for rise, _ in seen.pulses(f"{kind}_valid") if rise < end)
    drawing = Drawing(
        title, rise - 2 * seen.clock, end + 4 * seen.clock, seen.clock / 8, ("clock", seen.clock)
    )
    drawing.level("clk", [(at, level) for at, level in seen.values["clk"] if at >= drawing.start], idle=1)
    seen.lanes(drawing, f"{kind}_valid", f"{kind}_ready")
    # The other values change with the firmware, and nobody may use them.
    drawing.blocks(f"{kind}_addr", [Block(rise, end, str(place), FROM_CARD)], between="x")
    first, last = (rise, end) if kind == "write" else (end, end + seen.clock)
    drawing.blocks(f"{kind}_data", [Block(first, last, f"{byte:02X}", filling)], between="x")
    assert round((end - rise) / seen.clock) == 1
    when = "in the clock of ready" if kind == "write" else "in the clock after ready"
    drawing.foot = f"Place {place}, byte {byte:02X}h {when}. Valid for 1 clock: this memory is ready at once."
    return drawing


def drive_port() -> Drawing:
    """The ports of drive_port during a telegram and its reply."""
    seen = Port("drive_i", START)
    telegram, answer = seen.characters("tx", FROM_CARD), seen.characters("rx", FROM_OUTSIDE)
    started = seen.after("telegram_start", 0)
    good = next(at for at, level in seen.edges["good"] if level)
    drawing = Drawing(
        "drive_port: a telegram and its reply", started - 12 * BIT, answer[-1].end + 26 * BIT, 2 * BIT
    )
    drawing.group("pins")
    seen.lanes(drawing, "de")
    drawing.blocks("tx", telegram)
    drawing.blocks("rx", answer)
    drawing.group("memory")
    seen.memory(drawing, "read", FROM_CARD)
    seen.memory(drawing, "write", FROM_OUTSIDE)
    drawing.group("exchange")
    seen.lanes(drawing, "sending", "quiet", "candidate", "good")
    drawing.group("control")
    seen.lanes(drawing, "telegram_start", "listening")
    first = bits(telegram[0].start - started)
    right = bits(answer[-1].end - good)
    pause = bits(answer[0].start - telegram[-1].end)
    drawing.arrows((telegram[-1].end, answer[0].start, f"drive's delay: {pause}"))
    drawing.foot = (
        f"The first start bit leaves {first} after telegram_start. good comes {right} before the end."
    )
    return drawing


DRAWINGS: dict[str, Callable[[], Drawing]] = {
    "character": character,
    "commit": commit,
    "revoke": revoke,
    "start-motor": start_motor,
    "exception": refusal,
    "broadcast": broadcast,
    "loop-back": loop_back,
    "network-port": network_port,
    "memory-write": partial(handshake, "write", "network_port: a byte goes to the frame memory", FROM_CARD),
    "memory-read": partial(
        handshake, "read", "network_port: a byte comes from the frame memory", FROM_OUTSIDE
    ),
    "drive-port": drive_port,
}


def main() -> int:
    parser = Parser(prog="diagrams", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(DRAWINGS)} (default: all)")
    args = parser.parse_args()
    if unknown := [name for name in args.names if name not in DRAWINGS]:
        parser.error(f"no diagram '{unknown[0]}'; there are {', '.join(DRAWINGS)}")
    if not args.names:  # the site shows what is there
        shutil.rmtree(DIAGRAMS, ignore_errors=True)
    DIAGRAMS.mkdir(parents=True, exist_ok=True)
    for name in args.names or DRAWINGS:
        drawing = DRAWINGS[name]()
        (DIAGRAMS / f"{name}.svg").write_text(svg(drawing))
        (DIAGRAMS / f"{name}.json").write_text(json.dumps(drawing.json, indent=1, ensure_ascii=False) + "\n")
        print(DIAGRAMS.relative_to(ROOT) / f"{name}.svg")
    return 0


if __name__ == "__main__":
    run_main("diagrams", main)
