# SPDX-License-Identifier: Apache-2.0
# Masters that are not ours, for sim/card/test_judges.py. Included by the top Makefile; works by itself too.

# Written beside and moved: a test running meanwhile never starts half a program.
build/host/libmodbus_client: sim/card/libmodbus_client.c sim/card/judges.mk
	@mkdir -p $(@D)
	$(or $(HOST_CC),gcc) -std=c99 -O1 -Wall -Wextra -Werror -Wconversion -o $@.$$$$ $< -lmodbus && mv $@.$$$$ $@
