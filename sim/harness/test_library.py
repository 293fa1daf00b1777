# SPDX-License-Identifier: Apache-2.0
"""The one recipe of the Verilated card: no build is stale, and none is made twice."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from rtl import cache
from rtl.sources import card_files
from sim.harness import library


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The folders that a build was made in; Verilator and the compiler do not run."""
    folders: list[Path] = []
    monkeypatch.setattr(cache, "folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(library, "_verilate", lambda folder, *_: folders.append(folder))
    monkeypatch.setattr(library, "_link", lambda folder, extra: shutil.copy(__file__, folder / "libcard.so"))
    return folders


def test_a_library_of_other_sources_is_not_used(made: list[Path], tmp_path: Path) -> None:
    source = tmp_path / "card.v"
    found = []
    for text in ("module rtu2fc; endmodule\n", "module rtu2fc; wire a; endmodule\n"):
        source.write_text(text)
        found += [library.build(1_000_000, sources=[source]) for _ in range(2)]
    assert found[0] == found[1] != found[2] == found[3]
    assert [path.parent.name for path in (found[0], found[2])] == [folder.name for folder in made]


def test_another_checkout_compiles_nothing(made: list[Path], tmp_path: Path, monkeypatch) -> None:
    """The same files in other places are the same card."""
    for name in ("one", "two"):
        sources = [tmp_path / name / path.name for path in card_files()]
        sources[0].parent.mkdir()
        for path, copy in zip(card_files(), sources, strict=True):
            shutil.copy(path, copy)
        monkeypatch.setattr(cache, "ROOT", tmp_path / name)
        library.build(1_000_000, sources=sources)
    assert len(made) == 1


def test_each_setting_has_a_library_of_its_own(made: list[Path]) -> None:
    found = {
        library.build(1_000_000),
        library.build(2_000_000),
        library.build(1_000_000, parameters={"MASTER_LOSS_STOP": 1}),
        library.build(1_000_000, config="tiny"),
        library.build(1_000_000, extra="waves"),
    }
    assert len(found) == len(made) == 5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("trigger index 0 is active: @(posedge clk)", "knows clk and rst_n alone"),
        (
            "\n".join((*library.TRIGGERS, "trigger index 2 is active: @(negedge clk)")),
            "knows clk and rst_n alone",
        ),
        ("\n".join((*library.TRIGGERS, "void Vrtu2fc___024root___eval_ico()")), "a register at each input"),
    ],
)
def test_a_model_with_other_clocks_is_refused(tmp_path: Path, monkeypatch, text: str, said: str) -> None:
    (tmp_path / "Vrtu2fc___024root__0.cpp").write_text(text)
    monkeypatch.setattr(library, "_tool", lambda *command: "")
    with pytest.raises(library.BuildError, match=said):
        library._verilate(tmp_path, card_files(), {}, "")
