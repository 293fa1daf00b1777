# SPDX-License-Identifier: Apache-2.0
# Simulated drive: parameter tables and the shared library for the Python side. Included by the top
# Makefile; also works alone (make -f sim/drive/drive.mk drive), as tb/model/vlt_drive.py uses it.

# Every table in this folder is a profile.
DRIVE_PROFILES := $(sort $(wildcard sim/drive/*.csv))
DRIVE_TABLES := build/sim/drive_profiles.h
DRIVE_SOURCES := sim/drive/vlt_drive.c
# For programs that link the drive: use these flags and DRIVE_SOURCES, and make DRIVE_TABLES first.
DRIVE_CPPFLAGS := -Isim/drive -Ibuild/sim
DRIVE_CFLAGS := -std=c99 -O2 -Wall -Wextra -Werror -Wconversion

.PHONY: drive
drive: build/host/libvltdrive.so

$(DRIVE_TABLES): $(DRIVE_PROFILES) sim/drive/drive_table.py sim/drive/drive.mk
	python3 sim/drive/drive_table.py $(DRIVE_PROFILES) $@

# Linked under another name and then moved, so that a running test never loads an incomplete library.
build/host/libvltdrive.so: $(DRIVE_SOURCES) sim/drive/vlt_drive.h sim/drive/drive.mk $(DRIVE_TABLES)
	@mkdir -p $(@D)
	$(or $(HOST_CC),gcc) $(DRIVE_CFLAGS) $(DRIVE_CPPFLAGS) -fPIC -shared -o $@.partial $(DRIVE_SOURCES)
	@mv $@.partial $@
