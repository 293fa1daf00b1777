# SPDX-License-Identifier: Apache-2.0
# The fuzzers of the firmware: for each dialect one of the translation core and one of the poll loop, with address
# and undefined-behaviour sanitizers, built from copies of the sources that count loop rounds. Included by the top
# Makefile; also works alone (make -f sw/test/fuzz.mk fuzzers).

# Asked for when a fuzzer is built.
FUZZ_CC = $(shell tools/setup.sh --command clang)
FUZZ_PYTHON ?= .venv/bin/python
FUZZ_DIR ?= build/fuzz-firmware
# The folder with the firmware's sources; a test sets it to a copy with a planted bug.
FUZZ_TREE ?= .
FUZZ_FLAGS ?= -O1
FUZZ_SANITIZERS := -fsanitize=fuzzer,address,undefined,implicit-conversion -fno-sanitize-recover=all
FUZZ_CFLAGS := -std=c99 -g -Wall -Wextra -Werror -Wconversion -Wstrict-prototypes -Wmissing-prototypes \
	-I$(FUZZ_TREE)/sw/include -I$(FUZZ_TREE)/sw/src -Iregs/generated -I$(FUZZ_TREE)/sw/port/host -Isw/test
FUZZ_DIALECTS := card builtin hvac_basic
FUZZ_TARGETS := translate gateway
FUZZERS := $(foreach dialect,$(FUZZ_DIALECTS),$(FUZZ_TARGETS:%=$(FUZZ_DIR)/$(dialect)/fuzz_%))
FUZZ_CORE := translate coils registers diagnostics telegram reply guard
FUZZ_ALL := $(FUZZ_CORE) gateway leds loopback image
FUZZ_SOURCES := $(wildcard $(FUZZ_TREE)/sw/src/*) $(wildcard $(FUZZ_TREE)/sw/*/*.h) $(wildcard $(FUZZ_TREE)/sw/port/host/*) \
	$(wildcard sw/test/*.[ch]) sw/test/loops.toml sw/test/fuzz.mk sw/test/loops.py

.PHONY: fuzzers
fuzzers: $(FUZZERS)

$(FUZZ_DIR)/src/counting: $(FUZZ_SOURCES) | $(SETUP)
	@mkdir -p $(@D)
	$(FUZZ_PYTHON) -m sw.test.loops --tree $(FUZZ_TREE) --instrument $(@D)
	@touch $@

fuzz_dialect = $(shell echo $(notdir $(patsubst %/,%,$(dir $@))) | tr a-z A-Z)
$(FUZZ_DIR)/%/fuzz_translate: $(FUZZ_DIR)/src/counting
	@mkdir -p $(@D)
	$(FUZZ_CC) $(FUZZ_CFLAGS) -I$(FUZZ_DIR)/src $(FUZZ_FLAGS) $(FUZZ_SANITIZERS) -DDIALECT=DIALECT_$(fuzz_dialect) -o $@ \
		sw/test/fuzz_translate.c sw/test/fuzz.c sw/test/loops.c $(FUZZ_TREE)/sw/port/host/host.c $(FUZZ_CORE:%=$(FUZZ_DIR)/src/%.c)

$(FUZZ_DIR)/%/fuzz_gateway: $(FUZZ_DIR)/src/counting
	@mkdir -p $(@D)
	$(FUZZ_CC) $(FUZZ_CFLAGS) -I$(FUZZ_DIR)/src $(FUZZ_FLAGS) $(FUZZ_SANITIZERS) -DDIALECT=DIALECT_$(fuzz_dialect) -o $@ \
		sw/test/fuzz_gateway.c sw/test/fuzz.c sw/test/loops.c $(wildcard $(FUZZ_TREE)/sw/port/host/*.c) $(FUZZ_ALL:%=$(FUZZ_DIR)/src/%.c)
