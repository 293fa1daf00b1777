# SPDX-License-Identifier: Apache-2.0
# Independent Modbus master for sim/card/test_judges.py. Included by the top Makefile; also works alone.

# Linked under another name and then moved, so that a running test never starts an incomplete program.
build/host/libmodbus_client: sim/card/libmodbus_client.c sim/card/judges.mk
	@mkdir -p $(@D)
	$(or $(HOST_CC),gcc) -std=c99 -O1 -Wall -Wextra -Werror -Wconversion -o $@.$$$$ $< -lmodbus && mv $@.$$$$ $@
