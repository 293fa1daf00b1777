# SPDX-License-Identifier: Apache-2.0
# The fuzzer of the firmware in each dialect, with address and undefined-behaviour sanitizers. Included by the top
# Makefile; also works alone (make -f sw/test/fuzz.mk fuzzers).

# Asked for when a fuzzer is built.
FUZZ_CC = $(shell tools/setup.sh --command clang)
FUZZ_DIR ?= build/fuzz-firmware
# The folder with the firmware's sources; a test sets it to a copy with a planted bug.
FUZZ_TREE ?= .
FUZZ_FLAGS ?= -O1
FUZZ_SANITIZERS := -fsanitize=fuzzer,address,undefined,implicit-conversion -fno-sanitize-recover=all
FUZZ_CFLAGS := -std=c99 -g -Wall -Wextra -Werror -Wconversion -Wstrict-prototypes -Wmissing-prototypes \
	-I$(FUZZ_TREE)/sw/include -I$(FUZZ_TREE)/sw/src -Iregs/generated -I$(FUZZ_TREE)/sw/port/host -Isw/test
FUZZ_DIALECTS := $(shell sed -n 's/^\[dialect\.\(.*\)\]/\1/p' regs/dialects.toml)
FUZZERS := $(FUZZ_DIALECTS:%=$(FUZZ_DIR)/%/fuzz_gateway)
# main.c runs on the card alone.
FUZZ_SOURCES := $(filter-out %/main.c,$(wildcard $(FUZZ_TREE)/sw/src/*.c)) $(wildcard $(FUZZ_TREE)/sw/port/host/*.c) \
	sw/test/fuzz.c sw/test/fuzz_gateway.c

.PHONY: fuzzers
fuzzers: $(FUZZERS)

fuzz_dialect = $(shell echo $(notdir $(patsubst %/,%,$(dir $@))) | tr a-z A-Z)
$(FUZZERS): $(FUZZ_SOURCES) $(wildcard $(FUZZ_TREE)/sw/*/*.h $(FUZZ_TREE)/sw/port/host/*.h sw/test/*.[ch]) \
		sw/test/fuzz.mk | $(SETUP)
	@mkdir -p $(@D)
	$(FUZZ_CC) $(FUZZ_CFLAGS) $(FUZZ_FLAGS) $(FUZZ_SANITIZERS) -DDIALECT=DIALECT_$(fuzz_dialect) -o $@ \
		$(FUZZ_SOURCES)
