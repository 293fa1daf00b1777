# SPDX-License-Identifier: Apache-2.0
# The measuring bench: the standard card at its own clock, Verilated into a library that sim/bench/card.py
# drives. Two builds: the card, and the same card with 'prepare early' switched off, to compare with.
# Included by the top Makefile, after sw/firmware.mk and sim/card/card.mk.

BENCH_DIR := build/bench_card
BENCH_EARLY := $(BENCH_DIR)/early/libcard.so
BENCH_LATE := $(BENCH_DIR)/late/libcard.so
BENCH_WAIVERS := tools/verilator.vlt sim/bench/probes.vlt
BENCH_CLK_HZ := $(shell python3 -c 'import tomllib; print(tomllib.load(open("configs.toml", "rb"))["standard"]["clk_hz"])')
BENCH_RTL := $(wildcard rtl/*.v rtl/generated/*) rtl/rtl.f configs.toml tools/sources.py $(BENCH_WAIVERS)

BENCH_VERILATOR_FLAGS := --cc --build --top-module rtu2fc --no-timing --no-assert -O3 --x-assign fast \
	--x-initial fast --timescale-override 1ns/1ns -Wno-lint -CFLAGS -fPIC \
	-MAKEFLAGS "PYTHON3=python3 VK_PCH_I_FAST= VK_PCH_I_SLOW= OPT_FAST=-O3" \
	-GCLK_HZ=$(BENCH_CLK_HZ) '-GFIRMWARE_HEX="build/firmware.hex"'
BENCH_CXXFLAGS := -std=c++17 -O3 -fPIC -shared -fvisibility-inlines-hidden -fno-gnu-unique -Wl,-Bsymbolic \
	-Wall -Wextra -Werror -DBENCH_CLK_HZ=$(BENCH_CLK_HZ)
BENCH_INCLUDES = $(addprefix -isystem $(shell $(CARD_VERILATOR) --getenv VERILATOR_ROOT)/,include include/vltstd)

.PHONY: bench-card
bench-card: $(BENCH_EARLY) $(BENCH_LATE)

$(BENCH_EARLY): BENCH_PREPARE := 1
$(BENCH_LATE): BENCH_PREPARE := 0
# Linked beside and moved: a test running meanwhile never loads half a library.
$(BENCH_EARLY) $(BENCH_LATE): sim/bench/card_bench.cpp sim/bench/bench.mk $(BENCH_RTL) | build/firmware.hex
	@mkdir -p $(@D)
	$(CARD_VERILATOR) $(BENCH_VERILATOR_FLAGS) --Mdir $(@D) -GPREPARE_EARLY=$(BENCH_PREPARE) $(BENCH_WAIVERS) \
		$$($(CARD_PYTHON) tools/sources.py) > $(@D)/model.log || { cat $(@D)/model.log >&2; exit 1; }
	$(or $(HOST_CXX),g++) $(BENCH_CXXFLAGS) -isystem $(@D) $(BENCH_INCLUDES) -o $@.partial $< \
		$(addprefix $(@D)/,libVrtu2fc.a libverilated.a) -lpthread
	@mv $@.partial $@
