// SPDX-License-Identifier: Apache-2.0
// The dialects of the card as its surroundings must know them: which firmware image speaks one, which drive
// it was made for, how its exception codes read (DIALECT-CARD, DIALECT-BUILTIN, DIALECT-HVAC-BASIC).

#ifndef DIALECT_H
#define DIALECT_H

#include <string>

namespace card {

struct Dialect {
  const char* name;
  const char* image_folder;  // from this program's folder on
  const char* profile;       // of sim/drive, unless another is asked for
  bool standard_exceptions;  // codes 1 to 4 mean what the Modbus standard says
};

// nullptr when there is no such dialect.
const Dialect* find_dialect(const std::string& name);
const Dialect& default_dialect();

}  // namespace card

#endif
