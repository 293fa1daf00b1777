# SPDX-License-Identifier: Apache-2.0
"""The engine of the campaigns: no case is lost or counted twice, however its runs end.

Every campaign with a page shows here that its template fits its results.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import sqlite3
import sys
from argparse import Namespace
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import pytest

from campaigns import engine
from campaigns.bench import judge, work
from campaigns.bench.conformance import ROWS
from campaigns.bench.run import CAMPAIGN as BENCH
from campaigns.bench.run import pieces
from campaigns.conformance.run import CAMPAIGN as CONFORMANCE
from campaigns.conformance.run import subjects
from campaigns.engine import Campaign, EngineError, Row, Store, total
from campaigns.flips import run as flips_run
from campaigns.flips.run import CAMPAIGN as FLIPS
from campaigns.flips.trial import FORBIDDEN, PARTS, Flip, Outcome
from campaigns.fuzz import impatient
from campaigns.fuzz import run as fuzz_run
from campaigns.fuzz.impatient import CAMPAIGN as IMPATIENT
from campaigns.fuzz.run import CAMPAIGN as FUZZ
from campaigns.line_quality.limits import QUANTITIES
from campaigns.line_quality.run import CAMPAIGN as LINE_QUALITY
from campaigns.line_quality.run import PIECES
from campaigns.masters.run import BY_ITSELF
from campaigns.masters.run import CAMPAIGN as MASTERS
from campaigns.masters.session import ENDLESS
from campaigns.masters.test_masters import records_of
from campaigns.soak import run as soak_run
from campaigns.soak.run import CAMPAIGN as SOAK
from campaigns.soak.run import Result
from campaigns.starts import run as starts_run
from campaigns.starts.run import CAMPAIGN as STARTS
from rtl.sources import ROOT
from sim.harness.library import Target
from sw.rtu2fc.cases import CASES
from sw.rtu2fc.engine import FAIL, PASS, Verdict
from tb.lib.rows import each_row
from tb.lib.seeds import seeded
from tb.model.told import Verdict as Told


class Squares(Campaign):
    """Cases that cost nothing. The one of number 3 goes wrong."""

    name, module = "squares", "campaigns.test_engine"
    count = 4
    made: list[str]

    def of(self, config: str) -> str:
        return "this card"

    def run(self, config: str, case: str) -> Row:
        self.made.append(case)
        number = int(case.split("/")[1])
        return {"wrong": "nine" if number == 3 else "", "square": number**2, "worst": {"number": number}}

    def follow(self, config: str, case: str) -> str:
        return f"a closer look at {case}"


CAMPAIGN = Squares()


@pytest.fixture
def squares(tmp_path, monkeypatch):
    """Runs the campaign with a command line, in this process."""
    CAMPAIGN.made = []
    engine._of.cache_clear()
    monkeypatch.setattr(engine, "in_processes", lambda jobs, task, cases: map(task, cases))

    def run(*options: str, store: str = "results.sqlite") -> int:
        monkeypatch.setattr(
            sys, "argv", ["squares", "--seed", "7", "--store", str(tmp_path / store), *options]
        )
        return CAMPAIGN.main()

    return run


def rows(path: Path) -> dict[str, Row]:
    return Store(path).rows("squares", "this card", "standard")


def test_a_run_goes_on_where_it_was_and_tells_of_an_earlier_failure(squares, capsys):
    assert squares("--count", "3") == 0
    assert "squares: standard card, seed 7, 3 cases" in capsys.readouterr().out
    assert squares("--count", "5") == 1
    said = capsys.readouterr().out
    assert "5 cases, 3 of them from an earlier run" in said and "a closer look at 7/3" in said
    assert "5 cases, 1 with a difference, at most 7.78e-01 of all at 99 %" in said
    assert squares("--count", "5") == 1 and "7/3: nine" in capsys.readouterr().out
    assert CAMPAIGN.made == [f"7/{number}" for number in range(5)], "no case runs twice"


def test_a_run_that_is_stopped_keeps_what_is_done(squares, tmp_path, monkeypatch):
    def stopped(jobs, task, cases):
        yield from map(task, cases[:2])
        raise KeyboardInterrupt

    monkeypatch.setattr(engine, "in_processes", stopped)
    with pytest.raises(KeyboardInterrupt):
        squares()
    assert list(rows(tmp_path / "results.sqlite")) == ["7/0", "7/1"]


def test_parts_that_are_merged_are_the_whole(squares, tmp_path):
    squares("--count", "20", store="whole")
    for number in (1, 2, 3):
        squares("--count", "20", "--part", f"{number}/3", store=f"part{number}")
    merged = Store(tmp_path / "merged")
    assert [merged.merge(tmp_path / f"part{number}") for number in (1, 2, 3, 2)] == [7, 7, 6, 0]
    assert rows(tmp_path / "merged") == rows(tmp_path / "whole") and len(rows(tmp_path / "whole")) == 20


def test_rows_are_added_up(squares, tmp_path):
    squares("--count", "12")
    found = rows(tmp_path / "results.sqlite")
    assert list(found)[-1] == "7/11", "sorted by number"
    sums = total(found.values())
    assert sums["square"] == sum(number**2 for number in range(12)) and sums["worst"] == {"number": 11}


def test_a_worker_with_another_card_is_refused(squares, monkeypatch):
    monkeypatch.setattr(engine, "_of", lambda module, config: "an older card")
    with pytest.raises(EngineError, match="a worker has another card, firmware or judge: an older card"):
        squares()


@each_row("options", [["--part", "4/3"], ["--part", "0/3"], ["--count", "0"]])
def test_a_wrong_option_is_refused_in_one_line(squares, capsys, options):
    with pytest.raises(SystemExit) as ended:
        squares(*options)
    assert ended.value.code == 2 and len(capsys.readouterr().err.splitlines()) == 1


def test_the_workers_of_a_scheduler_give_the_same_rows(squares, tmp_path, monkeypatch):
    """Dask is of a layer of its own; this one has its interface."""

    class Client(contextlib.nullcontext):
        def __init__(self, address: str, **how) -> None:
            if address != "tcp://here:1":
                raise OSError(address)
            super().__init__(self)

        def get_executor(self, pure: bool) -> ThreadPoolExecutor:
            assert not pure, "equal cases of two runs are two"
            return ThreadPoolExecutor(3)

    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=Client))
    squares("--count", "30", store="alone")
    squares("--count", "30", "--on", "tcp://here:1", store="others")
    assert rows(tmp_path / "others") == rows(tmp_path / "alone") and len(CAMPAIGN.made) == 60
    with pytest.raises(EngineError, match="no scheduler answers at tcp://there:1"):
        squares("--on", "tcp://there:1", store="none")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(EngineError, match="the package distributed is missing"):
        squares("--on", "tcp://here:1", store="none")


def test_a_file_that_is_no_store_is_refused(squares, tmp_path):
    (tmp_path / "text").write_text("no store, but a text of more than one line\n" * 50)
    with pytest.raises(EngineError, match="is no store of results"):
        squares(store="text")
    with sqlite3.connect(tmp_path / "other") as other:
        other.execute("CREATE TABLE results (something)")
    with pytest.raises(EngineError, match="is no store of results"):
        squares(store="other")
    for name in ("none", "text", "other"):
        with pytest.raises(EngineError, match="is no store of results"):
            Store(tmp_path / "new").merge(tmp_path / name)
    assert not (tmp_path / "none").exists()


def test_a_part_without_a_case_is_no_failure(squares, capsys):
    assert squares("--count", "2", "--part", "3/4") == 0
    assert capsys.readouterr().out == "squares: part 3 of 4 has no case\n"


def test_a_case_that_lacks_something_is_told_and_tried_again(squares, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        Squares, "run", lambda self, config, case: {"missing": "no cable"} if case == "7/1" else {"wrong": ""}
    )
    for _ in range(2):
        assert squares() == 2 and capsys.readouterr().err == "squares: 7/1: no cable\n"
        assert list(rows(tmp_path / "results.sqlite")) == ["7/0", "7/2", "7/3"]


def test_an_image_that_changes_during_a_run_ends_it(squares, tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "changes", lambda config: [len(CAMPAIGN.made)])
    with pytest.raises(EngineError, match="has changed during the run"):
        squares()
    assert not rows(tmp_path / "results.sqlite"), "a result of the other image is not kept"


def ends(case: str) -> tuple[str, str, Row]:
    sys.exit(case)


def test_a_process_that_ends_is_told_in_one_line(squares, monkeypatch):
    def killed(jobs, task, cases):
        yield task(cases[0])
        raise engine.BrokenProcessPool

    monkeypatch.setattr(engine, "in_processes", killed)
    with pytest.raises(EngineError, match="Finished cases are kept"):
        squares()


PROGRAMS = {path.parent.name: path for path in (ROOT / "campaigns").glob("*/run.py")}
UNTESTED = sorted(
    name
    for name, path in PROGRAMS.items()
    if "CAMPAIGN = " in path.read_text() and not any(path.parent.glob("test_*.py"))
)


@pytest.mark.parametrize("name", UNTESTED)
def test_a_case_of_a_campaign_without_a_test_of_its_own(tmp_path, monkeypatch, name):
    campaign = importlib.import_module(f"campaigns.{name}.run").CAMPAIGN
    assert campaign.name == name and campaign.module == f"campaigns.{name}.run"
    seed = seeded(name).randrange(1 << 31)
    monkeypatch.setattr(sys, "argv", [name, "--count=1", f"--seed={seed}", f"--store={tmp_path / 'store'}"])
    published: list[str] = []
    monkeypatch.setattr(engine, "publish", lambda name, text, *rest: published.append(text))
    for config in campaign.configs:
        monkeypatch.setattr(sys, "argv", [*sys.argv[:4], f"--config={config}"])
        assert campaign.main() == 0
    campaign.publish(Store(tmp_path / "store"))
    assert published and published[0].startswith("# ")


FRAMES = {"frames": 12, "judged": 11, "cases": 1, "events": {"legal": 12}, "cpu_s": 90.0, "simulated_s": 2.0}
FRAMES |= {"rates": {}, "outcomes": {}, "unclear": {}, "worst": {}, "differences": []}
FLIPPED = {"flips": 25, "flips_at": {"9600": 25}, "bits": {part: [8] for part in PARTS}, "cpu_s": 60.0}
FLIPPED |= {"counts": {"card: no effect": 24, f"card: {FORBIDDEN[0]}": 1}}
FLIPPED |= {
    "notable": [{"trial": "1/0", "flip": "gate_i.due[0]", "what": FORBIDDEN[0], "why": "at the commit"}]
}
BLOCK = {"wrong": "", "line": ["9600 bit/s 8E1"], "transactions": 500, "mismatches": 0}
BLOCK |= {"replies": {"function 03": 400, "exception 2": 100}, "simulated_s": 600.0}
FLIP = Flip(0, "gate_i.due", 0, 0, "card")

# What each campaign asks about the card, replaced by what finds a fault in each.


def silent(kind: str, config: str, seed: int) -> str:
    return f"{config}: silent"


def not_told(case: dict, config: str) -> Told:
    return Told([f"{config}: told something else"], 1)


def late(name: str, target: Target) -> Row:
    return FRAMES | {"differences": [{"case": name, "what": [f"{target.config}: late"]}]}


def unrequested(numbers: list[str], places: SimpleNamespace) -> list[Outcome]:
    return [Outcome(FLIP, FORBIDDEN[0], places.config) for _ in numbers]


def mismatch(*about: object) -> Result:
    return Result([], [f"{about[-1]}: mismatch"], 1, Counter(), 1.0, 1.0, "9600 bit/s 8E1")


def slow(piece: work.Piece) -> judge.Outcome:
    return judge.Outcome(faults=[f"{piece.build.config}: 2 bits after t3.5"])


FAULTS = {
    BENCH: (work.Piece, "run", slow),
    STARTS: (starts_run.starts, "start", silent),
    IMPATIENT: (impatient, "play", not_told),
    FUZZ: (fuzz_run, "row_of", late),
    FLIPS: (flips_run, "outcomes", unrequested),
    SOAK: (soak_run, "soak", mismatch),
}


@pytest.mark.parametrize("campaign", FAULTS, ids=lambda campaign: campaign.name)
def test_a_fault_is_seen_kept_and_told(tmp_path, monkeypatch, capsys, campaign):
    """Exit 1, also of the run that finds the rows in the store; the card is the one that was named."""
    monkeypatch.setattr(*FAULTS[campaign])
    bits = SimpleNamespace(bits=lambda part: 8, config="tiny")
    monkeypatch.setattr(flips_run, "places", lambda config, baud: bits)
    monkeypatch.setattr(type(campaign), "follow", lambda *about: "")
    monkeypatch.setattr(type(campaign), "of", lambda self, config: f"{config} card")
    play = functools.partial(done, campaign)
    monkeypatch.setattr(engine, "in_processes", lambda jobs, task, cases: map(play, cases))
    store = f"--store={tmp_path / 'store'}"
    count = ["--count=1"] if campaign.count else []
    monkeypatch.setattr(sys, "argv", [campaign.name, "--config=tiny", *count, "--seed=1", store])
    for _ in range(2):
        assert campaign.main() == 1
        assert "tiny" in capsys.readouterr().out.splitlines()[-1], "the card that was named"


def done(campaign: Campaign, case: str) -> tuple[str, str, Row]:
    return case, "tiny card", campaign.run("tiny", case)


@pytest.mark.parametrize("campaign", FAULTS, ids=lambda campaign: campaign.name)
def test_results_are_of_one_card_one_image_and_one_judge(monkeypatch, campaign):
    now = {name: name for name in ("card", "firmware", "every_image", "judge")}
    for name in now:
        monkeypatch.setattr(engine.fingerprint, name, lambda *about, name=name: f"{now[name]} {about}")
    before = campaign.of("standard")
    assert before != campaign.of("tiny")
    for name in ("card", "every_image" if campaign.every_dialect else "firmware", "judge"):
        was, now[name] = now[name], "another"
        assert campaign.of("standard") != before, name
        now[name] = was
    assert campaign.every_dialect == (campaign not in (BENCH, STARTS, FLIPS)), "the image `card` alone"


# ---------------------------------------------------------------- the pages


def limits(name: str) -> Row:
    """Of one piece of the line quality; the glitches of one are below LINE-5."""
    piece, width = PIECES[name], 0.2 if name == "network-115200-8N1-7372800" else 0.3
    where = {"line": name.split("-")[0], "baud": piece.line.baud, "form": piece.line.form}
    where |= {"clk_hz": piece.line.clk_hz, "characters": 60, "asked": 100}
    spans = {quantity.name: sum(quantity.theory(piece.line.form)) / 2 for quantity in QUANTITIES.values()}
    spans["glitch"] = width
    return {"limits": [{"quantity": what, "found": found, **where} for what, found in spans.items()]}


def measured(piece: work.Piece) -> Row:
    """Of one piece of the bench: a request, and one of the small card that was answered too late."""
    late = 1.25 if piece.name == "tiny-gate-9600-8E1" else 0.5
    sample = judge.Sample("read 16 coils", piece.baud, piece.form, local=late, total=0.02, decode_clocks=900)
    sample.floor_parts, sample.after_t35, sample.de_lead = {"request": 0.02}, [late], {"modbus": [0.5]}
    outcome = judge.Outcome(rows=dict.fromkeys(ROWS, "answered"))
    outcome.add(sample, "here")
    return outcome.row()


SLAVE = subjects()["holding_registers"].title


def verdicts(slave: str) -> Row:
    """Every test passed, but one by one slave."""
    of = {case.number: Verdict(case.number, PASS) for case in CASES}
    if slave == "holding_registers":
        of["SL-1"] = Verdict("SL-1", FAIL, "no reply")
    return {"wrong": "", "verdicts": [asdict(one) for one in of.values()]}


def answers(case: str) -> Row:
    """Of one master: right, but it waits for ever by itself."""
    part = case.split("/")[1]
    if part != BY_ITSELF:
        return {"version": "1.0", "answers": records_of(part), "wrong": ""}
    silent = {"builtin silent": [{"answer": ENDLESS, "sent": "", "took": 30.0}]}
    soon = {what: [{"answer": {"values": [50]}}] * 5 for what in ("card read-word", "card silent")}
    return {
        "defaults": silent | soon,
        "parity": {"values": [1]},
        "example": "",
        "system": "Linux",
        "socat": "1.7",
    }


RESULTS = (
    (CONFORMANCE, {name: verdicts(name) for name in subjects()}),
    (MASTERS, {case: answers(case) for case in MASTERS.cases(Namespace(master=None, dialect=None))}),
    (BENCH, {f"7/{name}": measured(piece) for name, piece in pieces(7).items()}),
    (FUZZ, {"7/0": FRAMES, "8/0": FRAMES | {"differences": [{"case": "8/0", "what": ["no reply"]}]}}),
    (IMPATIENT, {"9/0": {"wrong": "", "asked": 3, "restless": 1}}),
    (FLIPS, {"9600/1/0/25": FLIPPED}),
    (SOAK, {"card/vlt6000/1/500": BLOCK}),
    (LINE_QUALITY, {f"7/{name}": limits(name) for name in PIECES} | {"8/part": {"limits": []}}),
    (STARTS, {"power-up/1": {"wrong": ""}, "power-up/2": {"wrong": ""}, "reset/1": {"wrong": "silent"}}),
)


@pytest.fixture
def kept(tmp_path, monkeypatch) -> Store:
    """Results of every campaign, of both cards."""
    for name in ("card", "firmware", "judge", "now"):
        monkeypatch.setattr(engine.fingerprint, name, lambda *about, name=name: f"{name} {about}")
    store = Store(tmp_path / "store")
    for campaign, found in RESULTS:
        for config in ("standard", "tiny"):
            of = campaign.of(config)
            for case, row in found.items():
                store.keep(campaign.name, of, config, case, row)
    return store


@each_row(
    ("campaign", "said"),
    [
        (CONFORMANCE, f"| {SLAVE} | pins | ours | {len(CASES) - 1} | 0 | 1 | 0 | 0 |"),
        (CONFORMANCE, f"**{SLAVE}, pins: fails**\n\n- SL-1: no reply"),
        (MASTERS, "| mbpoll 1.0 | never | yes | yes | 0.1 s | goes on without parity |"),
        (MASTERS, "| read coil 129 | hvac_basic | 2 | **2** |"),
        (BENCH, "| local request: reply's first bit after t3.5 | ≤ 1 bit of the line | 0.50 | met |"),
        (BENCH, "- tiny: here: reply 1.250 bits after t3.5 (PERF-1)"),
        (
            FUZZ,
            "44 frames of both cards judged to their end, each with the judge of its row: cases with a "
            "difference: 2",
        ),
        (FUZZ, "| 7, 8 | 24 | 2 | 3 | 22 | 1 |"),
        (FUZZ, "| legal | 24 | 24 |"),
        (FUZZ, "| 9 | 1 | 3 | 1 | 0 |"),
        (FUZZ, "50 flips of both cards: 2 unrequested or altered telegrams and stuck drivers"),
        (LINE_QUALITY, "324 limits, 32,400 characters; 1 outside the limits of theory"),
        (LINE_QUALITY, "| width of a glitch | 0.200 | network line, 115200 8N1, 64 clocks a bit | 0.250 |"),
        (SOAK, "| vlt6000 | 1 | 9600: 8E1 | 500 | 0 | 9.17e-03 | 10 min |"),
        (SOAK, "- card, vlt6000: 100 exception 2, 400 function 03."),
        (STARTS, "| standard | power-up | 2 | 1 to 2 | 0 | 9.00e-01 |"),
        (STARTS, "| tiny | reset | 1 | 1 | 1 | 1.00e+00 |"),
    ],
)
def test_a_page_shows_the_results(kept, monkeypatch, campaign, said):
    written: dict[str, str] = {}
    monkeypatch.setattr(engine, "publish", lambda name, text, *rest: written.update({name: text}))
    campaign.publish(kept)
    assert said in written[campaign.name]
    assert "\n\n\n" not in written[campaign.name]


def test_a_page_needs_the_results_of_both_cards_as_they_are(kept):
    with sqlite3.connect(kept.base.execute("PRAGMA database_list").fetchone()[2]) as base:
        base.execute("UPDATE results SET fingerprint = 'older' WHERE config = 'tiny'")
    with pytest.raises(
        EngineError, match="no result of the tiny card as it is now; run `make soak CONFIG=tiny`"
    ):
        SOAK.publish(kept)
