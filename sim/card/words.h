// SPDX-License-Identifier: Apache-2.0
// Small pieces of text that both line descriptions need: parameter names, values, exception codes.

#ifndef WORDS_H
#define WORDS_H

#include <cstdint>
#include <string>
#include <vector>

namespace card {

// printf into a std::string.
__attribute__((format(printf, 1, 2))) std::string text(const char* format, ...);

// Two bytes, high byte first.
inline unsigned word(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return static_cast<unsigned>(bytes[at] << 8 | bytes[at + 1]);
}

// "parameter 514 (motor current)"
std::string parameter_name(unsigned pnu);
// "300 (3.00 A)"; `value` as transferred, sign extended by the parameter's type
std::string parameter_value(unsigned pnu, std::uint32_t value);
// Exception codes of the card, which are also the fault numbers of the drive.
const char* exception_name(unsigned code);
// Characters in quotes, a dot for each that cannot be printed.
std::string quoted(const std::uint8_t* bytes, std::size_t count);

}  // namespace card

#endif
