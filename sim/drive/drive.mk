# SPDX-License-Identifier: Apache-2.0
# Simulated drive: parameter tables and the shared library for the Python side. Included by the top
# Makefile; works by itself too (make -f sim/drive/drive.mk drive), which is how tb/model/vlt_drive.py
# builds what it loads.

# Every table here is a profile.
DRIVE_PROFILES := $(sort $(wildcard sim/drive/*.csv))
DRIVE_TABLES := build/sim/drive_profiles.h
DRIVE_SOURCES := sim/drive/vlt_drive.c
# What a program needs that links the drive itself: these flags, DRIVE_SOURCES, DRIVE_TABLES made first.
DRIVE_CPPFLAGS := -Isim/drive -Ibuild/sim
DRIVE_CFLAGS := -std=c99 -O2 -Wall -Wextra -Werror -Wconversion

.PHONY: drive
drive: build/host/libvltdrive.so

$(DRIVE_TABLES): $(DRIVE_PROFILES) sim/drive/drive_table.py sim/drive/vlt_drive.h sim/drive/drive.mk
	python3 sim/drive/drive_table.py $(DRIVE_PROFILES) $@

# Written beside and moved: a test running meanwhile never loads half a library.
build/host/libvltdrive.so: $(DRIVE_SOURCES) sim/drive/vlt_drive.h sim/drive/drive.mk $(DRIVE_TABLES)
	@mkdir -p $(@D)
	$(or $(HOST_CC),gcc) $(DRIVE_CFLAGS) $(DRIVE_CPPFLAGS) -fPIC -shared -o $@.partial $(DRIVE_SOURCES)
	@mv $@.partial $@
