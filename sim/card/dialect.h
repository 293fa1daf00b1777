// SPDX-License-Identifier: Apache-2.0
// Dialects of the card: firmware image, default drive and wording of the exception codes
// (DIALECT-CARD, DIALECT-BUILTIN, DIALECT-HVAC-BASIC).

#ifndef DIALECT_H
#define DIALECT_H

#include <string>

namespace card {

struct Dialect {
  const char* name;
  const char* image_folder;  // relative to this program's folder
  const char* profile;       // default drive profile of sim/drive
  bool standard_exceptions;  // codes 1 to 4 mean what the Modbus standard says
};

// Below this program's folder: the image of the dialect card with STATUS_REFRESH, and those of the other dialects
// without it (MAP-1).
constexpr const char* kStatusRefreshFolder = "/refresh";
constexpr const char* kNoStatusRefreshFolder = "/norefresh";
// Those with MASTER_LOSS_STOP (SAFE-7).
constexpr const char* kMasterLossStopFolder = "/stop";

// nullptr when there is no such dialect.
const Dialect* find_dialect(const std::string& name);
const Dialect& default_dialect();

}  // namespace card

#endif
