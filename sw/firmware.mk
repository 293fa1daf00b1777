# SPDX-License-Identifier: Apache-2.0
# Firmware: the images for the card, and a library of the same sources for tests on the host.
# Included by the top Makefile; also works alone (make -f sw/firmware.mk firmware).

FIRMWARE_CROSS ?= riscv64-unknown-elf-
FIRMWARE_PYTHON ?= python3
# Each dialect has an image in a folder of its own; the image of the card dialect is in build. Images with another option
# are below a folder that names it.
# From regs/dialects.toml by make regs: images
FIRMWARE_DIALECTS := builtin hvac_basic
FIRMWARE_FOLDERS := build $(FIRMWARE_DIALECTS:%=build/%)
FIRMWARE_LARGE := build/large $(FIRMWARE_DIALECTS:%=build/large/%)
FIRMWARE_FOLDERS += build/refresh
build/refresh/%: FIRMWARE_BY_NAME := -DSTATUS_REFRESH=1
FIRMWARE_FOLDERS += build/norefresh/builtin build/norefresh/hvac_basic
build/norefresh/%: FIRMWARE_BY_NAME := -DSTATUS_REFRESH=0
FIRMWARE_FOLDERS += build/stop build/stop/builtin
build/stop/%: FIRMWARE_BY_NAME := -DMASTER_LOSS_STOP=1
FIRMWARE_FOLDERS += build/delay5
build/delay5/%: FIRMWARE_BY_NAME := -DREPLY_DELAY=5
FIRMWARE_FOLDERS += build/delay20
build/delay20/%: FIRMWARE_BY_NAME := -DREPLY_DELAY=20
FIRMWARE_FOLDERS += build/gaps build/gaps/builtin build/gaps/hvac_basic
build/gaps/%: FIRMWARE_BY_NAME := -DSTRICT_T15=0
FIRMWARE_FOLDERS += build/breaks build/breaks/builtin build/breaks/hvac_basic
build/breaks/%: FIRMWARE_BY_NAME := -DBREAK_TOLERANT=1
FIRMWARE_FOLDERS += build/gaps_breaks build/gaps_breaks/builtin build/gaps_breaks/hvac_basic
build/gaps_breaks/%: FIRMWARE_BY_NAME := -DSTRICT_T15=0 -DBREAK_TOLERANT=1
FIRMWARE_LARGE += build/large/all build/large/all/builtin build/large/all/hvac_basic
build/large/all/%: FIRMWARE_BY_NAME := -DSTATUS_REFRESH=1 -DMASTER_LOSS_STOP=1 -DDIAGNOSTICS=1
# end of images
# Build options, such as -DSTATUS_REFRESH=1; see sw/include/options.h.
FIRMWARE_DEFINES ?=
FIRMWARE_HOST_DIR ?= build/host

# Bytes of memory, from configs.toml: $(call firmware_config,tiny,memory_bytes).
firmware_config = $(shell $(FIRMWARE_PYTHON) -c 'import tomllib; \
	print(tomllib.load(open("configs.toml", "rb"))["$1"]["$2"])')
# Bytes of stack that the linker reserves in every image; sw/tools/stack.py compares them with the deepest path.
FIRMWARE_STACK := 144

FIRMWARE_SOURCES := $(addprefix sw/src/,\
	translate.c coils.c registers.c diagnostics.c telegram.c request.c orders.c exchange.c gateway.c \
	leds.c loopback.c image.c)
FIRMWARE_CARD := sw/port/card/start.S sw/src/main.c
FIRMWARE_HOST := $(addprefix sw/port/host/,host.c mailbox_model.c machine.c)
FIRMWARE_HEADERS := $(wildcard sw/include/*.h sw/src/*.h sw/port/*/*.h regs/generated/*.h)

FIRMWARE_CFLAGS := -std=c99 -Wall -Wextra -Werror -Wconversion -Wshadow -Wstrict-prototypes \
	-Wmissing-prototypes -Isw/include -Isw/src -Iregs/generated
# Without a C library, loops must not become calls of memcpy and the like. Without jump tables sw/tools/stack.py knows
# the target of each jump. The options from -fira-loop-pressure on shorten this code, so that it fits the memory of the
# small card.
FIRMWARE_CARD_CFLAGS := -Isw/port/card -Os -g -march=rv32i -mabi=ilp32 -flto -ffreestanding -ffunction-sections \
	-fno-tree-loop-distribute-patterns -fno-jump-tables -fira-loop-pressure -fno-inline-small-functions \
	-fno-ipa-vrp -fno-guess-branch-probability -fno-expensive-optimizations -fno-tree-loop-optimize \
	-fno-tree-tail-merge -fno-caller-saves
FIRMWARE_LDFLAGS = -nostdlib -Lregs/generated -Wl,-T,sw/port/card/link.ld,--gc-sections,--build-id=none \
	-Wl,--no-warn-rwx-segments,--defsym=RAM_SIZE=$(FIRMWARE_MEMORY),--defsym=STACK_SIZE=$(FIRMWARE_STACK)

.PHONY: firmware firmware-size firmware-sources firmware-images
FIRMWARE_TINY := build/tiny/firmware
FIRMWARE_ELFS := $(FIRMWARE_FOLDERS:%=%/firmware.elf) $(FIRMWARE_TINY).elf
# The boards with a larger memory run images of their own. All options at once, below build/large/all, fit there
# in every dialect.
FIRMWARE_ELFS += $(FIRMWARE_LARGE:%=%/firmware.elf)
FIRMWARE_CONFIG := standard
# The small card has one core (rtl/soft_core.v).
FIRMWARE_LOCKSTEP = $(if $(filter tiny,$(FIRMWARE_CONFIG)),0,1)
$(FIRMWARE_TINY).elf $(FIRMWARE_TINY).hex: FIRMWARE_CONFIG := tiny
FIRMWARE_MEMORY = $(call firmware_config,$(FIRMWARE_CONFIG),memory_bytes)
build/large/%: FIRMWARE_MEMORY = $(shell $(FIRMWARE_PYTHON) -c 'import tomllib; \
	print(tomllib.load(open("constraints/boards.toml", "rb"))["card-gw1n-9"]["memory_bytes"])')
firmware: $(FIRMWARE_ELFS:.elf=.hex)

# A folder with the name of a dialect has its image, any other folder that of the dialect card.
FIRMWARE_DIALECT = $(shell echo $(or $(filter $(FIRMWARE_DIALECTS),$(notdir $(@D))),card) | tr a-z A-Z)
FIRMWARE_OPTIONS = -DDIALECT=DIALECT_$(FIRMWARE_DIALECT) $(FIRMWARE_BY_NAME) $(FIRMWARE_DEFINES)

# Written only when it changes: other options are a reason to build.
.PHONY: firmware-options
build/firmware.options: firmware-options
	@mkdir -p $(@D)
	@echo '$(FIRMWARE_DEFINES)' | cmp -s - $@ || echo '$(FIRMWARE_DEFINES)' >$@

$(FIRMWARE_ELFS): $(FIRMWARE_CARD) $(FIRMWARE_SOURCES) $(FIRMWARE_HEADERS) sw/port/card/link.ld \
		regs/generated/frames.ld sw/firmware.mk configs.toml build/firmware.options | $(SETUP)
	@mkdir -p $(@D)
	$(FIRMWARE_CROSS)gcc $(FIRMWARE_CFLAGS) $(FIRMWARE_CARD_CFLAGS) -DLOCKSTEP=$(FIRMWARE_LOCKSTEP) $(FIRMWARE_OPTIONS) \
		$(FIRMWARE_LDFLAGS) \
		-o $@ $(FIRMWARE_CARD) $(FIRMWARE_SOURCES)

$(FIRMWARE_ELFS:.elf=.bin): %.bin: %.elf sw/tools/seal.py
	$(FIRMWARE_CROSS)objcopy -O binary $< $@.unsealed
	$(FIRMWARE_PYTHON) sw/tools/seal.py $@.unsealed $@

$(FIRMWARE_ELFS:.elf=.hex): %.hex: %.bin sw/tools/bin2hex.py
	$(FIRMWARE_PYTHON) sw/tools/bin2hex.py --bytes $(FIRMWARE_MEMORY) $< $@

$(FIRMWARE_LARGE:%=%/firmware.elf): constraints/boards.toml

# The list for tools that compile the sources themselves.
firmware-sources:
	@echo $(FIRMWARE_SOURCES)

# The list of the images, for the release.
firmware-images:
	@echo $(FIRMWARE_ELFS:.elf=.hex)

# text: code and constants; bss: variables. The stack is not included.
firmware-size: $(FIRMWARE_ELFS)
	$(FIRMWARE_CROSS)size $^

$(addsuffix /libtranslate.so,$(FIRMWARE_HOST_DIR) $(addprefix build/host/,$(FIRMWARE_DIALECTS))): \
		$(FIRMWARE_SOURCES) $(FIRMWARE_HOST) $(FIRMWARE_HEADERS) sw/firmware.mk | $(SETUP)
	@mkdir -p $(@D)
	$(CC) $(FIRMWARE_CFLAGS) -Isw/port/host $(FIRMWARE_OPTIONS) -g -O1 -fPIC -shared -o $@ \
		$(FIRMWARE_SOURCES) $(FIRMWARE_HOST)
