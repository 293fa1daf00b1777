// SPDX-License-Identifier: Apache-2.0
// Dialects of the card: firmware image, default drive and wording of the exception codes (DIALECT).

#pragma once

#include <string>
#include <vector>

namespace card {

// An option that chooses an image.
struct Flag {
  const char* name;
  const char* help;
};

struct Dialect {
  const char* name;
  const char* about;
  const char* profile;       // default drive profile of sim/drive
  bool standard_exceptions;  // codes 1 to 4 mean what the Modbus standard says
  // Folders of its images, relative to this program's folder: without a flag, then with each of kFlags. nullptr: no
  // such image.
  std::vector<const char*> images;
};

// The first dialect is the default.
// From regs/dialects.toml by make regs: dialects
inline const std::vector<Flag> kFlags = {
    {"--status-refresh", "a read of coils 33-64 asks the drive first"},
    {"--no-status-refresh", "it reads the status of the drive's last reply"},
    {"--master-loss-stop", "the drive is stopped when the master is silent for the time of 40002"},
};

inline const std::vector<Dialect> kDialects = {
    {"card", "the option card's own", "vlt6000", false,
     {"", "/refresh", "", "/stop"}},
    {"builtin", "as VLT 2800, 6000, 8000 with Modbus built in", "vlt6000", false,
     {"/builtin", "/builtin", "/norefresh/builtin", "/stop/builtin"}},
    {"hvac_basic", "as the VLT HVAC Basic Drive", "hvac_basic", true,
     {"/hvac_basic", "/hvac_basic", "/norefresh/hvac_basic", nullptr}},
};
// end of dialects

// nullptr when there is no such dialect.
inline const Dialect* find_dialect(const std::string& name) {
  for (const Dialect& dialect : kDialects)
    if (name == dialect.name) return &dialect;
  return nullptr;
}

}  // namespace card
