# SPDX-License-Identifier: Apache-2.0
# The recorder of the virtual card, as a library for the test benches; tb/lib/recording.py builds it when it is
# needed. Included by the top Makefile; also works alone: make -f sim/view/record.mk recorder.

ifndef DRIVE_TABLES
include sim/drive/drive.mk
endif

RECORD_PARTS := describe frame led_watch recording
RECORD_SOURCES := sim/view/record.cpp $(RECORD_PARTS:%=sim/card/%.cpp)
RECORD_FLAGS := -std=c++17 -O2 -Wall -Wextra -Werror -fPIC -Isim/card -Iregs/generated

.PHONY: recorder
recorder: build/host/librecord.so

build/host/librecord.so: $(RECORD_SOURCES) $(wildcard sim/card/*.h regs/generated/*.h) sim/view/record.mk \
		build/host/vlt_drive.o
	@mkdir -p $(@D)
	$(or $(HOST_CXX),g++) $(RECORD_FLAGS) $(DRIVE_CPPFLAGS) -shared -o $@.partial $(RECORD_SOURCES) \
		build/host/vlt_drive.o
	@mv $@.partial $@

build/host/vlt_drive.o: $(DRIVE_SOURCES) sim/drive/vlt_drive.h $(DRIVE_TABLES) sim/view/record.mk
	@mkdir -p $(@D)
	$(or $(HOST_CC),gcc) $(DRIVE_CFLAGS) $(DRIVE_CPPFLAGS) -fPIC -c -o $@ $<
