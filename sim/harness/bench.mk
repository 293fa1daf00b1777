# SPDX-License-Identifier: Apache-2.0
# The measuring bench: a card at its own clock, Verilated into a library that campaigns/bench/card.py drives.
# Builds: the standard card, the same with 'prepare early' switched off to compare with, and the tiny card.
# Included by the top Makefile, after sw/firmware.mk and sim/card/card.mk.

BENCH_DIR := build/bench_card
BENCH_CARDS := $(BENCH_DIR)/standard/libcard.so $(BENCH_DIR)/standard-late/libcard.so
BENCH_TINY := $(BENCH_DIR)/tiny/libcard.so
BENCH_WAIVERS := tools/verilator.vlt sim/harness/probes.vlt
BENCH_RTL := $(shell find rtl regs/generated -name "*.v") rtl/rtl.f configs.toml rtl/sources.py requirements.txt \
	$(BENCH_WAIVERS)

BENCH_SETTING = $(shell python3 -c 'import tomllib; \
	print(tomllib.load(open("configs.toml", "rb"))["$(BENCH_CONFIG)"]["$(1)"])')
BENCH_VERILATOR_FLAGS = --cc --build --top-module rtu2fc --no-timing --no-assert -O3 --x-assign fast \
	--x-initial fast --timescale-override 1ns/1ns -Wno-lint -CFLAGS -fPIC \
	-MAKEFLAGS "PYTHON3=python3 VK_PCH_I_FAST= VK_PCH_I_SLOW= OPT_FAST=-O3" --Mdir $(@D) \
	-GCLK_HZ=$(call BENCH_SETTING,clk_hz) '-GFIRMWARE_HEX="$(call BENCH_SETTING,firmware_hex)"' \
	-GPREPARE_EARLY=$(BENCH_PREPARE)
BENCH_CXXFLAGS := -std=c++17 -O3 -fPIC -shared -fvisibility-inlines-hidden -fno-gnu-unique -Wl,-Bsymbolic \
	-Wall -Wextra -Werror
BENCH_INCLUDES = $(addprefix -isystem $(shell $(CARD_VERILATOR) --getenv VERILATOR_ROOT)/,include include/vltstd)
BENCH_PYTHON := PYTHONPATH=. $(CARD_PYTHON)

.PHONY: bench-card bench-tiny
bench-card: $(BENCH_CARDS)

bench-tiny: $(BENCH_TINY)

$(BENCH_CARDS) $(BENCH_TINY): BENCH_CONFIG := standard
$(BENCH_CARDS) $(BENCH_TINY): BENCH_PREPARE := 1
$(BENCH_DIR)/standard-late/libcard.so: BENCH_PREPARE := 0
$(BENCH_TINY): BENCH_CONFIG := tiny
# Linked beside and moved: a test running meanwhile never loads half a library. It carries the fingerprint of its
# sources, so that nothing is measured on a card that is no longer that of this tree.
$(BENCH_CARDS) $(BENCH_TINY): sim/harness/card_bench.cpp sim/harness/line_player.h sim/harness/bench.mk \
		campaigns/bench/fingerprint.py $(BENCH_RTL) | firmware
	@mkdir -p $(@D)
	$(CARD_VERILATOR) $(BENCH_VERILATOR_FLAGS) $(BENCH_WAIVERS) \
		$$($(CARD_PYTHON) -m rtl.sources $(BENCH_CONFIG)) > $(@D)/model.log || { cat $(@D)/model.log >&2; exit 1; }
	$(or $(HOST_CXX),g++) $(BENCH_CXXFLAGS) -DBENCH_CARD='"'$$($(BENCH_PYTHON) -m campaigns.bench.fingerprint $(BENCH_CONFIG))'"' \
		-Isim/harness -isystem $(@D) $(BENCH_INCLUDES) -o $@.partial $< $(addprefix $(@D)/,libVrtu2fc.a libverilated.a) -lpthread
	@mv $@.partial $@
