// SPDX-License-Identifier: Apache-2.0
// Generated from configs.toml by `make regs`; edit that file, not this one.
//
// Configuration standard: defaults of the top's parameters. Clock in Hz, memory in bytes.

`define CONFIG_CLK_HZ 12000000
`define CONFIG_SOFT_CORE 2'd0  // picorv32
`define CONFIG_MEMORY_BYTES 8192
