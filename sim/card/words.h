// SPDX-License-Identifier: Apache-2.0
// Texts that both line descriptions share: parameter names, values, exception codes.

#ifndef WORDS_H
#define WORDS_H

#include <cstdint>
#include <string>
#include <vector>

#include "dialect.h"
#include "vlt_drive.h"

namespace card {

// printf into a std::string.
__attribute__((format(printf, 1, 2))) std::string text(const char* format, ...);

// Two bytes, high byte first.
inline unsigned word(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return static_cast<unsigned>(bytes[at] << 8 | bytes[at + 1]);
}

// Characters in quotes, a dot for each that cannot be printed.
std::string quoted(const std::uint8_t* bytes, std::size_t count);

// Fault numbers of the drive, which most dialects pass on as exception codes.
const char* fault_name(unsigned number);

// Wording for one dialect of the card and one kind of drive.
class Words {
 public:
  Words(const Dialect& dialect, const drive_profile_t& profile) : dialect_(dialect), profile_(profile) {}

  // "parameter 514 (motor current)"
  std::string parameter_name(unsigned pnu) const;
  // "300 (3.00 A)"; `value` as transferred, sign extended by the parameter's type
  std::string parameter_value(unsigned pnu, std::uint32_t value) const;
  bool is_text(unsigned pnu) const;
  // The parameter number in a PKE.
  unsigned pnu(unsigned pke) const { return pke & profile_.pnu_mask; }
  const char* exception_name(unsigned code) const;
  const char* drive() const { return profile_.name; }

 private:
  const drive_parameter_t* find(unsigned pnu) const;

  const Dialect dialect_;
  const drive_profile_t& profile_;
};

}  // namespace card

#endif
