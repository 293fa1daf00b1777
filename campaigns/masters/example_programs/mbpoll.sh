#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Registers and coils count from 1 here: -r 3 is 40003, -r 5140 is address 5139, -r 129 is coil 129.
line="-m rtu -a 1 -b 9600 -P none -s 2 -o 1 -1 -q"
mbpoll $line -t 4 -r 3 /dev/ttyUSB0
mbpoll $line -t 4:int -B -r 5140 /dev/ttyUSB0
mbpoll $line -t 0 -r 129 /dev/ttyUSB0
mbpoll $line -t 0 -r 1 /dev/ttyUSB0 0 0 1 1 1 1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0
# Coil 44 is of the drive's last reply: read a parameter first.
until mbpoll $line -t 4:int -B -r 5140 /dev/ttyUSB0 >/dev/null && mbpoll $line -t 0 -r 44 /dev/ttyUSB0 | grep -q "0$"; do
  sleep 1
done
echo stopped
