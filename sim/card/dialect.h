// SPDX-License-Identifier: Apache-2.0
// Dialects of the card: firmware image, default drive and wording of the exception codes (DIALECT).

#ifndef DIALECT_H
#define DIALECT_H

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
  // Folders of its images, relative to this program's folder: without a flag, then with each of flags(). nullptr: no
  // such image.
  std::vector<const char*> images;
};

const std::vector<Flag>& flags();
const std::vector<Dialect>& dialects();  // the first is the default
// nullptr when there is no such dialect.
const Dialect* find_dialect(const std::string& name);

}  // namespace card

#endif
