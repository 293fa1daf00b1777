# SPDX-License-Identifier: Apache-2.0
"""The top of a board's Verilog: the card behind its pins, with the polarities that their names tell.

A switch whose name ends in _n closes to ground, and an LED of such a name is lit by a low pin. button_n is
switch 9 of the baud switch, which only the loop-back test reads (LOOP-1). Without rst_n the card resets
itself.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

LINES = {"modbus": "network", "drive": "drive"}
WIRES = {"rx": "input", "tx": "output", "de": "output"}
LEDS = tuple(f"led_{line}_{colour}" for line in LINES for colour in ("red", "green"))
TEMPLATE = """\
// SPDX-License-Identifier: Apache-2.0
{about}
// Rules: TOP-1, LINE-6, LED-2.
`default_nettype none

module {top} #(
{parameters}
) (
{ports}
);
{body}
  rtu2fc #(
{settings}
  ) card_i (
{joins}
  );

endmodule

`default_nettype wire
"""
NO_RESET = """\
There is no reset pin. reset_sync holds the reset for the first clocks after
configuration, and the switches settle before the card starts."""


def groups(placed: Collection[str], held: Mapping[str, int]) -> dict[str, list[tuple[str, str, str]]]:
    """Direction, range and name of the board's ports; of a port's two names the one that has a pin."""

    def named(port: str) -> str:
        return port if port in placed else f"{port}_n"

    button = ["button_n"] * ("button_n" in placed)
    switches = [(f"[{9 - len(button)}:1]", named("sw_baud")), *(("", name) for name in button)]
    found = {"": [("input", "", name) for name in ("clk", *["rst_n"] * ("rst_n" in placed))]}
    found["switches; _n: to ground" + "; the button is switch 9 of the baud switch" * len(button)] = [
        ("input", *port) for port in (*switches, ("[8:1]", named("sw_addr")))
    ]
    for line, name in LINES.items():
        found[f"{name} line"] = [(way, "", f"{line}_{wire}") for wire, way in WIRES.items()]
    found["LEDs; _n: lit by a low pin"] = [("output", "", named(led)) for led in LEDS]
    found["held at a level"] = [("output", "", name) for name in held]
    return found


def verilog(
    top: str,
    about: list[str],
    parameters: Mapping[str, str],
    settings: Mapping[str, str],
    placed: Collection[str],
    held: Mapping[str, int],
) -> str:
    """`parameters` are the board's own, `settings` the card's; `placed` has the ports of the pin file."""
    listed = groups(placed, held)
    names = {name for ports in listed.values() for _, _, name in ports}
    low = [led for led in LEDS if led not in names]
    body = "".join(f"\n  assign {name} = 1'b{level};" for name, level in held.items())
    if low:
        body += "\n  // These LEDs are lit by a low pin.\n"
        body += "".join(f"  wire {led};\n" for led in low)
        width = max(map(len, low)) + len("_n")
        body += "".join(f"\n  assign {led + '_n':<{width}} = !{led};" for led in low)
    joins = {"": ["clk", "rst_n"], "switches": ["sw_baud", "sw_addr"]}
    joins |= {f"{name} line": [f"{line}_{wire}" for wire in WIRES] for line, name in LINES.items()}
    joins["LEDs"] = list(LEDS)
    outside = {"rst_n": "rst_n" if "rst_n" in names else "1'b1"}
    outside |= {port: f"~{port}_n" for port in joins["switches"] if port not in names}
    if "button_n" in names:
        outside["sw_baud"] = f"{{~button_n, {outside.get('sw_baud', 'sw_baud')}}}"
    inside = {port: f".{port}({outside.get(port, port)})" for ports in joins.values() for port in ports}
    return TEMPLATE.format(
        about="\n".join(
            f"// {line}".rstrip() for line in about + NO_RESET.splitlines() * ("rst_n" not in names)
        ),
        top=top,
        parameters=",\n".join(f"    parameter {name} = {value}" for name, value in parameters.items()),
        ports=_with_titles(
            {
                title: [f"{way:<6} wire {bits:<5} {name}" for way, bits, name in ports]
                for title, ports in listed.items()
            },
            4,
        ),
        body=f"{body}\n" if body else "",
        settings=",\n".join(f"      .{name}({value})" for name, value in settings.items()),
        joins=_with_titles({title: [inside[port] for port in ports] for title, ports in joins.items()}, 6),
    )


def _with_titles(groups: dict[str, list[str]], indent: int) -> str:
    """Lines with commas between them, and a comment before each group."""
    text = ""
    for title, lines in groups.items():
        if lines:
            text += " " * indent + f"// {title}\n" if title else ""
            text += "".join(f"{' ' * indent}{line},\n" for line in lines)
    return text.removesuffix(",\n")
