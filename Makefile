# SPDX-License-Identifier: Apache-2.0
# All of the project's commands; `make` alone lists them. Whatever is missing is installed first.
#
#   CONFIG=name   configuration of configs.toml (sources, card, run, demo, soak)   default: standard
#   SIM=name      icarus or verilator (test, waves)              default: both; waves: icarus
#   TEST=name     what `pytest -k` takes (test, waves)           default: all
#   MODULE=name   a module of rtl/ (formal, mutate)              default: all
#   JOBS=n        processes of a test run                        default: 2
#   BOARD=name    board of constraints/boards.toml (synth, image) default: all
#   FIRMWARE=file image for $readmemh (image)
#   CARD_ARGS=... more options of build/card (run), such as --profile vlt5000 --dialect builtin
#   SEED=n        repeats a run (soak, fuzz, fuzz-firmware, flips, core-flips) default: a new one
#   COUNT=n       network frames (fuzz, fuzz-plants), flips (flips, core-flips) default: 2000, 20000, 500, 6000
#   RUNS=n        executions of all fuzzers (fuzz-firmware)      default: a million
#   SHARD=I/N     a part of the work (mutate-firmware)           default: all
#   BENCH_ARGS=... more options of campaigns/bench/run.py (bench, bench-fast), such as --seed 7
#   FILE=name     a recording (wireshark)
#   CHECK=1       fails for a page with other figures instead of writing them (coverage-firmware)
#   V=1           show the commands

CONFIG ?= standard
SIM ?=
TEST ?=
JOBS ?= 2

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
MAKEFLAGS += --no-builtin-rules --no-print-directory $(if $(V),,--silent)
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

BUILD := build
VENV := .venv
PY := $(VENV)/bin/python
# The order-only prerequisite of everything that needs a tool.
SETUP := setup

export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export PYTHONDONTWRITEBYTECODE := 1
export OBJCACHE := ccache
export CCACHE_DIR := $(CURDIR)/$(BUILD)/ccache

MODBUS_LINK := $(BUILD)/modbus
PYTEST := $(PY) -m pytest $(if $(TEST),-k '$(TEST)')

.PHONY: help
help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-18s %s\n", $$1, $$2 }' Makefile

.PHONY: demo run card firmware
demo: card ## the manual's examples by real Modbus masters, with verdicts
	@$(PY) -m sim.card.demo

run: card ## the virtual card with its simulated drive, on a terminal as a panel
	@exec $(PY) -m sim.card.panel --modbus $(MODBUS_LINK) $(CARD_ARGS)

card: ## build/card, the virtual card (build/card --help); with CONFIG=tiny build/tiny/card
firmware: $(BUILD)/firmware.hex ## the images: standard, tiny and one a dialect

.PHONY: soak
soak: card drive ## long mixed traffic over the virtual card, against the models (SEED=)
	@$(PY) -m campaigns.soak.run $(if $(SEED),--seed $(SEED))

.PHONY: fuzz fuzz-plants fuzz-report flips flips-report core-flips
fuzz: firmware drive | $(SETUP) ## a shard of random lines and drives against the models (SEED=, COUNT=), or one case (REPLAY=, WAVE=)
	@$(PY) -m campaigns.fuzz.run $(if $(SEED),--seed $(SEED)) $(if $(COUNT),--count $(COUNT)) \
	  $(if $(REPLAY),--replay $(REPLAY)) $(if $(WAVE),--wave $(WAVE))

fuzz-plants: firmware drive | $(SETUP) ## how many frames each planted bug lives
	@$(PY) -m campaigns.fuzz.run --plants --seed $(or $(SEED),1) --count $(or $(COUNT),20000)

flips: firmware drive | $(SETUP) ## a shard of single flipped bits under traffic (SEED=, COUNT=, BAUD=), or one flip (TRIAL=)
	@$(PY) -m campaigns.flips.run $(if $(SEED),--seed $(SEED)) $(if $(COUNT),--count $(COUNT)) \
	  $(if $(BAUD),--baud $(BAUD)) $(if $(TRIAL),--trial $(TRIAL))

core-flips: firmware | $(SETUP) ## flipped registers of the core alone, while it makes a telegram (SEED=, COUNT=)
	@$(PY) -m campaigns.flips.core $(if $(SEED),--seed $(SEED)) $(if $(COUNT),--count $(COUNT))

flips-report: | $(SETUP) ## all shards of flips in build/fuzz as one table
	@$(PY) -m campaigns.flips.run --report

fuzz-report: | $(SETUP) ## all shards' results in build/fuzz as one
	@$(PY) -m campaigns.fuzz.report

.PHONY: test test-slow test-tiny test-gates lint format
test: firmware card drive bench-card $(BUILD)/host/libtranslate.so | $(SETUP) ## all tests on both simulators, but for the slow ones (SIM=, TEST=)
	@$(PYTEST) -n $(JOBS) --dist=worksteal $(if $(SIM),--sim=$(SIM))

test-slow: firmware drive | $(SETUP) ## what `make test` leaves out: long tests on Icarus, covers of the proofs, builds of boards (TEST=)
	@$(PYTEST) -n $(JOBS) --dist=worksteal --slow

test-tiny: firmware | $(SETUP) ## the tests of the whole card as tiny, all on both simulators (SIM=, TEST=)
	@$(PYTEST) -n $(JOBS) --dist=worksteal --card=tiny $(if $(SIM),--sim=$(SIM))

test-gates: firmware | $(SETUP) ## the manual's examples on the card's netlists, some 4 minutes each (TEST=)
	@$(PY) -m pytest tb/gates/all.py -n $(JOBS) $(if $(TEST),-k '$(TEST)')

lint: | $(SETUP) ## every static check
	@$(PY) -m tools.lint

format: | $(SETUP) ## lay out Verilog and Python as lint wants them
	@$(PY) -m tools.lint --format

.PHONY: trace
trace: | $(SETUP) ## which test shows which rule, and its last result
	@$(PY) -m tools.trace

.PHONY: line-quality
line-quality: firmware drive | $(SETUP) ## how bad a line the card bears, at all rates and formats (SEED=, JOBS=)
	@$(PY) -m campaigns.line_quality.run $(if $(SEED),--seed $(SEED)) --jobs $(JOBS)

.PHONY: bench bench-fast
bench: bench-card bench-tiny card drive | $(SETUP) ## turnaround on the pins against the wire's floor; writes docs/reports/results.md
	@$(PY) -m campaigns.bench.run $(BENCH_ARGS)

bench-fast: bench-card drive | $(SETUP) ## the part of it that make test runs too, in under a minute
	@$(PY) -m campaigns.bench.run --fast $(BENCH_ARGS)

.PHONY: formal mutate
formal: | $(SETUP) ## prove what formal/ promises, and write docs/reports/proofs.md (MODULE=)
	@$(PY) -m formal.prove $(MODULE) --jobs $(JOBS) $(if $(MODULE),,--write)

mutate: firmware | $(SETUP) ## break modules and see whether proofs and benches notice (MODULE=, default all: hours)
	@$(PY) -m campaigns.mutate.run $(or $(MODULE),--all) --jobs $(JOBS) --write

.PHONY: synth image
synth: firmware | $(SETUP) ## bitstreams, and what they take of their parts; all boards also write docs/reports/synthesis.md (BOARD=)
	@$(PY) -m constraints.synth $(BOARD)

image: firmware | $(SETUP) ## another firmware into a board's finished design (BOARD=, FIRMWARE=)
	@[ -n "$(BOARD)" ] && [ -n "$(FIRMWARE)" ] || \
		{ echo "say which: make image BOARD=name FIRMWARE=file.hex" >&2; exit 2; }
	@$(PY) -m constraints.image "$(BOARD)" "$(FIRMWARE)"

.PHONY: pins
pins: | $(SETUP) ## the boards' pin tables, docs/reference/pins.md
	@$(PY) -m constraints.boards

.PHONY: diagrams
diagrams: firmware | $(SETUP) ## timing diagrams from runs of the card, docs/diagrams
	@$(PY) -m tools.diagrams

.PHONY: coverage-rtl
coverage-rtl: firmware | $(SETUP) ## lines, branches and toggles of rtl/ that the benches run; each hole explained
	@$(PY) -m campaigns.coverage.run --jobs $(JOBS)

.PHONY: coverage-firmware fuzz-firmware mutate-firmware
coverage-firmware: firmware | $(SETUP) ## branches of the firmware that its host tests take; 100 % of its core (CHECK=1)
	@$(PY) -m sw.test.coverage $(if $(CHECK),--check,--write)

fuzz-firmware: | $(SETUP) ## fuzzes the firmware against its oracles (RUNS=, SEED=, JOBS=)
	@$(PY) -m sw.test.fuzz $(if $(RUNS),--runs $(RUNS)) $(if $(SEED),--seed $(SEED)) --jobs $(JOBS) --write

mutate-firmware: firmware | $(SETUP) ## mutants of the translation core that its tests catch (SHARD=I/N, JOBS=)
	@$(PY) -m sw.test.mutate $(if $(SHARD),--shard $(SHARD),--jobs $(JOBS) --write)

.PHONY: report symptoms
report: | $(SETUP) ## tests, rules, figures and pictures in one page, build/report.html
	@$(PY) -m tools.report

symptoms: firmware | $(SETUP) ## the recordings of docs/guide/debugging.md, from runs of the card
	@$(PY) -m tools.symptoms

.PHONY: waves
waves: firmware | $(SETUP) ## waveform, capture and log of a test: make waves TEST=name
	@[ -n "$(TEST)" ] || { echo "say which test: make waves TEST=name" >&2; exit 2; }
	@WAVES=1 $(PYTEST) -q --sim=$(or $(SIM),icarus) || { code=$$?; \
		[ $$code != 5 ] || echo "waves: no test of that name runs on $(or $(SIM),icarus): $(TEST)" >&2; exit $$code; }

.PHONY: wireshark
wireshark: | $(SETUP) ## open a recording, both lines decoded: make wireshark FILE=name.pcapng
	@$(PY) -m sim.view.wireshark $(FILE)

.PHONY: regs regs-check
regs: | $(SETUP) ## everything derived from regs/
	@$(PY) -m regs.regs
	@$(PY) -m sim.view.fc_tables

regs-check: | $(SETUP) ## fail when something derived from regs/ has drifted
	@$(PY) -m regs.regs --check
	@$(PY) -m sim.view.fc_tables --check

.PHONY: sources
sources: | $(SETUP) ## every Verilog file of the whole card (CONFIG=)
	@$(PY) -m rtl.sources $(CONFIG)

.PHONY: setup clean
setup: ## install what is missing (done by the others too)
	@tools/setup.sh

clean: ## remove build/
	@rm -rf $(BUILD)

# A fixed path: on the first call there is nothing to look up yet.
CARD_VERILATOR := $(VENV)/verilator/bin/verilator

include sw/firmware.mk sim/drive/drive.mk sim/card/card.mk sim/view/record.mk sim/harness/bench.mk sim/card/judges.mk

# Whatever a compiler makes waits for the compiler to be there.
$(BUILD)/firmware.elf $(BUILD)/host/libtranslate.so $(BUILD)/host/libvltdrive.so: | $(SETUP)
$(CARD_MODEL)/Vrtu2fc.h $(CARD_OBJECTS) $(BENCH_CARDS) $(BENCH_TINY): | $(SETUP)
