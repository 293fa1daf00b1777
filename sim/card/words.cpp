// SPDX-License-Identifier: Apache-2.0

#include "words.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "fc_words.h"

namespace card {

std::string text(const char* format, ...) {
  char buffer[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

const char* fault_name(unsigned number) {
  for (const fc_words::Fault& fault : fc_words::kFaults)
    if (fault.number == number) return fault.name;
  return "other fault of the drive";
}

const drive_parameter_t* Words::find(unsigned pnu) const {
  for (unsigned i = 0; i < profile_.count; ++i)
    if (profile_.parameters[i].pnu == pnu) return &profile_.parameters[i];
  return nullptr;
}

std::string Words::parameter_name(unsigned pnu) const {
  const drive_parameter_t* parameter = find(pnu);
  std::string words = "parameter " + std::to_string(pnu);
  if (parameter != nullptr) words += std::string(" (") + parameter->name + ")";
  return words;
}

bool Words::is_text(unsigned pnu) const {
  const drive_parameter_t* parameter = find(pnu);
  return parameter != nullptr && parameter->type == DRIVE_TEXT;
}

std::string Words::parameter_value(unsigned pnu, std::uint32_t value) const {
  const drive_parameter_t* parameter = find(pnu);
  if (parameter == nullptr) return text("%u", value);
  std::int64_t number = value;
  if (parameter->type == DRIVE_INT16) number = static_cast<std::int16_t>(value);
  if (parameter->type == DRIVE_INT32) number = static_cast<std::int32_t>(value);
  const std::string raw = std::to_string(number);
  const int conversion = parameter->conversion;
  const bool scaled = conversion < 0 && conversion > -6;
  if (!scaled && parameter->unit[0] == '\0') return raw;
  if (!scaled) return raw + " " + parameter->unit;
  return raw + text(" (%.*f%s%s)", -conversion, static_cast<double>(number) * std::pow(10.0, conversion),
                    parameter->unit[0] == '\0' ? "" : " ", parameter->unit);
}

const char* Words::exception_name(unsigned code) const {
  if (dialect_.standard_exceptions) {
    switch (code) {
      case 1: return "unknown function";
      case 2: return "no such coil or register";
      case 3: return "wrong quantity or value";
      case 4: return "refused by the drive";
      default: return "no code of this dialect";
    }
  }
  switch (code) {
    case 64: return "no such coil or register";
    case 65: return "wrong length of the message";
    case 66: return "wrong quantity, length or value of the data";
    case 67: return "unknown function";
    case 255: return "no answer from the drive";
    default: return fault_name(code);
  }
}

std::string quoted(const std::uint8_t* bytes, std::size_t count) {
  std::string words = "'";
  for (std::size_t i = 0; i < count; ++i)
    words += bytes[i] >= 0x20 && bytes[i] < 0x7F ? static_cast<char>(bytes[i]) : '.';
  return words + "'";
}

}  // namespace card
