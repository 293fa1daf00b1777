// SPDX-License-Identifier: Apache-2.0

#include "words.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "vlt_drive.h"

namespace card {

namespace {

const drive_parameter_t* find_parameter(unsigned pnu) {
  static const drive_profile_t* const profile = drive_profile("vlt6000");
  for (unsigned i = 0; i < profile->count; ++i)
    if (profile->parameters[i].pnu == pnu) return &profile->parameters[i];
  return nullptr;
}

}  // namespace

std::string text(const char* format, ...) {
  char buffer[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

std::string parameter_name(unsigned pnu) {
  const drive_parameter_t* parameter = find_parameter(pnu);
  std::string words = "parameter " + std::to_string(pnu);
  if (parameter != nullptr) words += std::string(" (") + parameter->name + ")";
  return words;
}

std::string parameter_value(unsigned pnu, std::uint32_t value) {
  const drive_parameter_t* parameter = find_parameter(pnu);
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

const char* exception_name(unsigned code) {
  switch (code) {
    case 0: return "parameter does not exist";
    case 1: return "no write access";
    case 2: return "value exceeds limits";
    case 3: return "sub-index does not exist";
    case 4: return "parameter is no array";
    case 5: return "data type does not match";
    case 17: return "not possible in the present mode";
    case 64: return "no such coil or register";
    case 65: return "wrong length of the message";
    case 66: return "wrong quantity or length of the data";
    case 67: return "unknown function";
    case 130: return "no bus access";
    case 131: return "factory setup selected";
    case 255: return "no answer from the drive";
    default: return "other fault of the drive";
  }
}

std::string quoted(const std::uint8_t* bytes, std::size_t count) {
  std::string words = "'";
  for (std::size_t i = 0; i < count; ++i)
    words += bytes[i] >= 0x20 && bytes[i] < 0x7F ? static_cast<char>(bytes[i]) : '.';
  return words + "'";
}

}  // namespace card
