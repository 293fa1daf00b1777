# SPDX-License-Identifier: Apache-2.0
# Every command of the project. `make` lists the daily ones, `make help-all` lists all. Each command installs the
# tools that it needs and that are missing (tools/setup.sh).
#
# Lines `##@` name the groups of the lists. `## text` after a target describes it; `## * text` puts it into the list
# of `make`. Durations were measured on two idle cores with warm tools; a command without one was not measured.

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
RUN := $(PY) -m
# The order-only prerequisite of everything that the virtual card needs.
SETUP := setup-demo

export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
# Compiled Python outside the sources. A simulation starts in half the time with it.
export PYTHONPYCACHEPREFIX := $(CURDIR)/$(BUILD)/pycache
unexport PYTHONDONTWRITEBYTECODE
export OBJCACHE := ccache
# As rtl/cache.py: kept for every checkout, so without the checkout's path.
export CCACHE_DIR := $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/rtu2fc/ccache
export CCACHE_MAXSIZE := 500M
export CCACHE_BASEDIR := $(CURDIR)
# The random tests of pytest: the same seed in each run, unless SEED= gives another.
export COCOTB_RANDOM_SEED := $(SEED)
ifeq ($(SEED),)
unexport COCOTB_RANDOM_SEED
endif
ifeq ($(shell [[ '$(SEED)' =~ ^[0-9]*$$ ]] && echo number),)
$(error SEED=$(SEED): a whole number)
endif

ifeq ($(shell [[ '$(JOBS)' =~ ^[1-9][0-9]*$$ ]] && echo number),)
$(error JOBS=$(JOBS): a whole number of 1 or more)
endif

# A line's rate has one name in every command, the usual one of serial tools.
ifneq ($(filter command,$(origin RATE)),)
$(error there is no RATE=: say BAUD=$(RATE))
endif

MODBUS_LINK := $(BUILD)/modbus
# A test file may be given with its folder; pytest -k takes its name.
NAMED = $(notdir $(TEST))
PYTEST = $(RUN) pytest --durations=30 -n $(JOBS) --dist=worksteal $(if $(SIM),--sim=$(SIM)) $(if $(CARD),--card=$(CARD)) \
	$(if $(TEST),-k '$(NAMED)')
# What the tests start.
TESTED = firmware card drive bench-card $(BUILD)/host/libtranslate.so

# The tools that the tests named by TEST= need; ends the command if no test fits: $(call named,command).
named = [ -z "$(TEST)" ] || { layers=$$($(RUN) tools.names $(1) '$(NAMED)' $(if $(SIM),--sim=$(SIM)) \
	$(if $(CARD),--card=$(CARD))) && { [ -z "$$layers" ] || tools/setup.sh $$layers; }; }

# ---------------------------------------------------------------- help
help:
	@$(call list,0)
	@echo; echo "make help-all lists every command, every campaign and every variable."

help-all: ## every command, every campaign and every variable
	@$(call list,1)
	@sed -n 's/^#: //p' Makefile

list = awk -v all=$(1) -F ':.*\#\# ' '\
	function show(name, text) { if (group != "") { printf "\n%s\n", group; group = "" } printf "  make %-18s %s\n", name, text } \
	/^\#\#@ / { group = substr($$0, 5) } \
	/^[a-z-]+:.*\#\# / { text = $$2; daily = sub(/^\* /, "", text); if (all || daily) show($$1, text) } \
	all && $(DESCRIBED) { split(substr($$0, 4), part, /; `make |`\./); show(part[2], part[1]) }' Makefile \
	<(echo '\#\#@ Campaigns') campaigns/*/*.py
DESCRIBED = /^""".*; `make [a-z-]+`\.("""|$$)/

#:
#: Variables
#:   CONFIG=name   configuration of configs.toml (sources, card, run, demo, replay, campaigns); default: standard
#:   TEST=name     part of the tests, as pytest -k takes it, or a test file (test, nightly, test-gates, waves)
#:   SIM=name      icarus or verilator (test, nightly, waves); CARD=name: the whole card's tests as this card
#:   FOLDERS=names of these folders the tests that are not in make test (nightly)
#:   SEED=n        seed of random tests and campaigns; without it the tests take a fixed seed, campaigns draw one
#:   NAME=value    of a campaign: its option --name; `python -m campaigns.FOLDER.run --help` lists them. Of those that
#:                 count cases: ON=address of a Dask scheduler; PART=I/N: each N-th case; STORE=file; PAGE=yes
#:   RUNS=n        executions (fuzz-firmware)
#:   MODULE=name   a module of rtl/ (formal, formal-flips); BOARD=name: a board of constraints/boards.toml, or the file of your own (synth, image)
#:   FILE=name     a recording (wireshark, telegrams, replay); FIRMWARE=file: an image (image)
#:   UNIT=, BAUD=, CHANNEL=name, FORMAT=8N2, INVERT=yes, REPLIES=no, FOR=s, DIALECT=name, STRICT_T15=no,
#:   BREAK_TOLERANT=yes   docs/guide/debugging.md (replay)
#:   JOBS=n        processes; default: 2. CHECK=1: write nothing (coverage-firmware, evidence, digests)
#:   PORT=device   of a real card's adapter; UNIT=, BAUD=, FORMAT=, DIALECT= as the card is set; DRIVE=yes: a drive is
#:                 connected; BOOT=yes, ROW=text, START=percent: docs/guide/bring-up.md (selftest)
#:   EXTENDED_SWITCHES=1   38400 and 115200 bit/s and 8N1 (card); BOARD=name-extended likewise (synth, image, release)
#:   CARD_ARGS=...   more options of build/card (run); ONLY=kind, FAST=yes: a part (bench)
#:   DRAFT=1       a development build: files named -draft; BOARD=name: with this board alone; TAG=v1.2.3: refused
#:                 unless it is that of VERSION (release)
#:   CHANNEL=name, INVERT=yes   the drive line's (telegrams); TELEGRAMS_ARGS=...   more options of rtu2fc decode
#:   V=1           show the commands

##@ Use the card
demo: card ## * the manual's examples, asked by real Modbus masters (30 s)
	@$(RUN) sim.card.demo

run: card ## * the virtual card with a simulated drive: a panel in the terminal (at once after make card)
	@exec $(RUN) sim.card.panel --modbus $(MODBUS_LINK) $(CARD_ARGS)

card: ## * build/card, the virtual card as a program; build/card --help (25 s after a change)

wheels: | setup-test ## the command rtu2fc for any computer, and the agents, as Python packages: build/wheels (10 s)
	@$(RUN) tools.wheels

firmware: $(BUILD)/firmware.hex ## the firmware images: both cards, each dialect, each option, boards with 16 KiB

waves: firmware | setup-test ## * waveform, capture and log of a test: make waves TEST=name (10 s for a module)
	@[ -n "$(TEST)" ] || { echo "say which test: make waves TEST=name" >&2; exit 2; }
	@$(RUN) tools.names waves '$(NAMED)' --sim=$(or $(SIM),icarus) >/dev/null
	@mkdir -p $(BUILD)/waves && touch $(BUILD)/waves/begun
	@WAVES=1 $(RUN) pytest -q --all --sim=$(or $(SIM),icarus) -k '$(NAMED)'
	@[ -n "$$(find $(BUILD)/waves -name '*.fst' -newer $(BUILD)/waves/begun)" ] || \
		{ echo "waves: '$(NAMED)' fits no test that simulates the card or a module" >&2; exit 2; }

wireshark: | setup-views ## open a recording, both lines decoded: make wireshark FILE=name.pcapng
	@$(RUN) sim.view.wireshark $(FILE)

telegrams: | setup-test ## the FC telegrams of a logic analyser's file: make telegrams FILE=mine.sr CHANNEL=D0
	@[ -n "$(FILE)" ] || { echo "say which file: make telegrams FILE=mine.sr CHANNEL=D0" >&2; exit 2; }
	@$(RUN) sw.rtu2fc decode "$(FILE)" --drive-line $(or $(CHANNEL),drive) $(if $(filter yes,$(INVERT)),--invert) $(TELEGRAMS_ARGS)

replay: firmware | setup-test ## a recorded bus (.sr, .vcd) played to the card: what it makes of each frame (FILE=)
	@[ -n "$(FILE)" ] && [ -n '$(call given,unit,UNIT)' ] && [ -n '$(call given,baud,BAUD)' ] || \
		{ echo "say which: make replay FILE=bus.sr UNIT=1 BAUD=9600" >&2; exit 2; }
	@$(RUN) sim.view.replay "$(FILE)" $(foreach option,unit baud channel format invert replies for config dialect,\
		$(call given,$(option),$(call upper,$(option)))) \
		$(call given,strict-t15,STRICT_T15) $(call given,break-tolerant,BREAK_TOLERANT)

##@ Test
test: | setup-test ## * every rule of the card, each test of a few seconds (3 min; from a clean clone 4 min, without the build cache 6; TEST=name: a part)
	@$(call named,test)
	@$(MAKE) -j$(JOBS) $(TESTED)
	@$(PYTEST) $(if $(TEST),--all)

nightly: | setup-test ## * every test: both cards, both simulators, boards, pages (46 min; TEST=name: a part)
	@$(if $(TEST),$(call named,nightly),tools/setup.sh all)
	@$(MAKE) -j$(JOBS) $(TESTED)
	@$(PYTEST) --all $(if $(FOLDERS),-m nightly $(FOLDERS))

test-gates: firmware | setup-synth ## the manual's examples on finished images (1 to 4 minutes each; TEST=)
	@$(RUN) pytest tb/gates/all.py -n $(JOBS) $(if $(TEST),-k '$(NAMED)')

lint: | setup-lint ## * every static check (1 min)
	@$(RUN) tools.lint

format: | setup-lint ## * lay out Verilog and Python (3 s)
	@$(RUN) tools.lint --format

trace: | setup-test ## * which test shows which rule, and its last result (8 s)
	@$(RUN) tools.trace

##@ Prove
formal: | setup-test ## * prove the promises of formal/ (3 min; MODULE=name: one module)
	@$(RUN) formal.prove $(MODULE) --jobs $(JOBS) $(if $(MODULE),,--write)

formal-flips: | setup-test ## prove that one flipped bit does no harm (5 min; MODULE=name)
	@$(RUN) formal.flips $(MODULE) --jobs $(JOBS) $(if $(MODULE),,--write)

##@ Measure
# Built by content: at once if nothing has changed.
bench-card: firmware | setup-test ## the simulated card of the bench
	@$(RUN) sim.harness.library bench

bench-tiny: firmware | setup-test ## the same of the small card
	@$(RUN) sim.harness.library tiny

evidence: | setup-test ## * renew every measured page that is of another card (2 h; ONLY=report; CHECK=1: only name them)
	@$(RUN) tools.evidence $(if $(CHECK),--check) $(if $(ONLY),--only "$(ONLY)")

results: | setup-test ## add the results of other machines: make results FILES="one.sqlite two.sqlite"
	@$(RUN) campaigns.engine merge $(FILES)

##@ Firmware
coverage-firmware: firmware | setup-firmware ## branches of the firmware that its host tests take (CHECK=1)
	@$(RUN) sw.test.coverage $(if $(CHECK),--check,--write)

fuzz-firmware: | setup-firmware ## fuzz the firmware against its oracles (RUNS=)
	@$(RUN) sw.test.fuzz $(if $(RUNS),--runs $(RUNS)) $(if $(SEED),--seed $(SEED)) --jobs $(JOBS) --write

##@ Build for hardware
synth: firmware | setup-synth ## * bitstreams and resource use (12 min; BOARD=name: one board; all boards write the report)
	@$(RUN) constraints.synth --jobs $(JOBS) $(BOARD)

image: firmware | setup-synth ## another firmware into a finished bitstream (BOARD=, FIRMWARE=)
	@[ -n "$(BOARD)" ] && [ -n "$(FIRMWARE)" ] || \
		{ echo "say which: make image BOARD=name FIRMWARE=file.hex" >&2; exit 2; }
	@$(RUN) constraints.image "$(BOARD)" "$(FIRMWARE)"

pins: | setup-synth ## the boards' tables in the docs, and build/boards
	@$(RUN) constraints.boards
	@$(RUN) tools.handbook

selftest: | setup-demo ## a real card over a serial adapter: a tick or a cross a row (PORT=; starts no motor without START=)
	@[ -n "$(PORT)" ] || { echo "say which port: make selftest PORT=/dev/ttyUSB0" >&2; exit 2; }
	@$(RUN) sw.rtu2fc check "$(PORT)" $(foreach option,unit baud format dialect drive boot start row,\
		$(call given,$(option),$(call upper,$(option)))) || \
		{ code=$$?; [ $$code = 130 ] || exit $$code; } # after Ctrl-C make adds no line of its own

# --name "value" for a variable that was given to make itself: the environment's START or ROW starts nothing.
given = $(if $(filter command,$(origin $(2))),--$(1) "$($(2))")
upper = $(shell tr a-z A-Z <<<'$(1)')

serial-drive: drive | setup-demo ## a simulated drive on a serial port, for a card without a drive (PORT=/dev/ttyUSB1)
	@[ -n "$(PORT)" ] || { echo "say which port: make serial-drive PORT=/dev/ttyUSB1" >&2; exit 2; }
	@$(RUN) sim.drive.serial_drive "$(PORT)"

sources: | setup-demo ## every Verilog file of the whole card, one a line (CONFIG=)
	@$(RUN) rtl.sources $(CONFIG)

portability: firmware | setup-synth ## the card in other people's tools: Yosys's flows for six other makers, slang (1 min)
	@$(RUN) pytest -q --all constraints/test_portability.py

##@ Write what is generated
regs: | setup-test ## everything derived from regs/
	@$(RUN) regs.regs
	@$(RUN) tools.handbook

regs-check: | setup-test ## fail when something derived from regs/ has drifted
	@$(RUN) regs.regs --check
	@$(RUN) tools.handbook --check

diagrams: firmware | setup-test ## timing diagrams from runs of the card: build/diagrams
	@$(RUN) tools.diagrams

symptoms: firmware | setup-test ## the recordings of the debugging guide, from runs of the card
	@$(RUN) tools.symptoms

docs: | setup-docs ## the documentation site, readable offline: build/docs-site/index.html (3 s; pictures: make diagrams)
	@$(RUN) tools.site.build

# The description of a program of campaigns/ begins with what it does, and "; `make NAME`.": it is that command. Each
# variable of the command line is an option of it: COUNT=5 as --count "5". Its line `# needs: card | setup-test` has
# other prerequisites than these.
NEEDS := firmware drive | setup-test
CAMPAIGNS := $(shell awk 'FNR == 1 { needs = "$(NEEDS)" } sub(/^\# needs: /, "") { needs = $$0 } \
	$(DESCRIBED) { gsub(" ", ",", needs); sub(/`\..*/, ""); sub(/.*`make /, ""); \
	print $$0 "=" FILENAME "=" needs }' campaigns/*/*.py)
GIVEN = $(strip $(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name))))
OPTIONS = $(foreach name,$(filter-out V %_ARGS $(if $(findstring --jobs,$(file <$(1)))$(findstring campaigns.engine,$(file <$(1))),,JOBS),$(GIVEN)),--$(shell \
	tr A-Z_ a-z- <<<'$(name)') "$($(name))")
comma := ,
# Name, file and prerequisites.
define campaign
.PHONY: $(1)
$(1): $(subst $(comma), ,$(3))
	@$(if $(ON),tools/setup.sh machines)
	@$$(RUN) $(subst /,.,$(basename $(2))) $$(call OPTIONS,$(2)) $$($$(call upper,$(1))_ARGS)

endef
$(foreach each,$(CAMPAIGNS),$(eval $(call campaign,$(word 1,$(subst =, ,$(each))),$(word 2,$(subst =, ,$(each))),$(word \
	3,$(subst =, ,$(each))))))

##@ Workshop
release: diagrams | setup-synth setup-docs ## all files of a release: build/dist (DRAFT=1, BOARD=name)
	@$(RUN) tools.release $(if $(TAG),--tag "$(TAG)") $(if $(DRAFT),--draft) $(if $(BOARD),--board $(BOARD))

digests: | setup-test ## SHA-256 of images: tools/digests.txt (CHECK=1: compare; BOARD=name or all: its designs, bitstreams, too)
	@$(if $(BOARD),tools/setup.sh synth)
	@$(RUN) tools.digests $(if $(CHECK),--check) $(if $(BOARD),--board $(BOARD))

version: ## the version of the release, as in VERSION
	@tools/setup.sh --version

setup: setup-all ## install everything at once, but for make masters (the other commands install what they need)

LAYERS := demo test views pages lint firmware synth docs masters machines all
.PHONY: $(LAYERS:%=setup-%) $(shell sed -n 's/^\([a-z-]*\):\( .*\)\?$$/\1/p' Makefile)
$(LAYERS:%=setup-%): setup-%:
	@tools/setup.sh $*

clean: ## remove build/
	@rm -rf $(BUILD)

# A fixed path: on the first call there is nothing to look up yet.
CARD_VERILATOR := $(VENV)/verilator/bin/verilator

include sw/firmware.mk sim/drive/drive.mk sim/card/card.mk sim/view/record.mk

# A target that a compiler makes is made after the set-up of the compiler.
$(BUILD)/firmware.elf $(BUILD)/host/libtranslate.so $(BUILD)/host/libvltdrive.so: | $(SETUP)
$(CARD_MODEL)/Vrtu2fc.h $(CARD_OBJECTS): | $(SETUP)
