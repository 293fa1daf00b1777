// SPDX-License-Identifier: Apache-2.0

#include "dialect.h"

namespace card {

namespace {
// From regs/dialects.toml by make regs: dialects
const std::vector<Flag> kFlags = {
    {"--status-refresh", "a read of coils 33-64 asks the drive first"},
    {"--no-status-refresh", "it reads the status of the drive's last reply"},
    {"--master-loss-stop", "the drive is stopped when the master is silent for the time of 40002"},
};

const std::vector<Dialect> kDialects = {
    {"card", "the option card's own", "vlt6000", false,
     {"", "/refresh", "", "/stop"}},
    {"builtin", "as VLT 2800, 6000, 8000 with Modbus built in", "vlt6000", false,
     {"/builtin", "/builtin", "/norefresh/builtin", "/stop/builtin"}},
    {"hvac_basic", "as the VLT HVAC Basic Drive", "hvac_basic", true,
     {"/hvac_basic", "/hvac_basic", "/norefresh/hvac_basic", nullptr}},
};
// end of dialects
}  // namespace

const std::vector<Flag>& flags() { return kFlags; }

const std::vector<Dialect>& dialects() { return kDialects; }

const Dialect* find_dialect(const std::string& name) {
  for (const Dialect& dialect : kDialects)
    if (name == dialect.name) return &dialect;
  return nullptr;
}

}  // namespace card
