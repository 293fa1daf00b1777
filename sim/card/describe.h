// SPDX-License-Identifier: Apache-2.0
// Checks the frames of both lines, and describes them in words for log and terminal.

#pragma once

#include "dialect.h"
#include "frame.h"
#include "vlt_drive.h"

namespace card {

// Whether bytes are a whole Modbus RTU frame: length and CRC.
bool complete_adu(const Bytes& bytes);

// In the words of one dialect of the card and one kind of drive.
class Describer {
 public:
  Describer(const Dialect& dialect, const drive_profile_t& profile) : dialect_(dialect), profile_(profile) {}
  const char* drive_name() const { return profile_.name; }
  // Fills frame.flaw and frame.what.
  void describe(Frame& frame);

 private:
  const drive_parameter_t* find(unsigned pnu) const;
  // "parameter 514 (motor current)"
  std::string parameter_name(unsigned pnu) const;
  // "300 (3.00 A)"; `value` as transferred, sign extended by the parameter's type
  std::string parameter_value(unsigned pnu, std::uint32_t value) const;
  bool is_text(unsigned pnu) const;
  const char* exception_name(unsigned code) const;

  std::string registers(unsigned address, unsigned count) const;
  std::string register_values(const Bytes& adu, std::size_t at, unsigned address, unsigned count) const;
  std::string modbus_request(const Bytes& adu) const;
  std::string modbus_reply(const Bytes& adu) const;
  void modbus(Frame& frame);

  std::string parameter_words(const Bytes& telegram, bool reply) const;
  std::string telegram_words(const Bytes& telegram, bool reply) const;
  void drive(Frame& frame) const;

  const Dialect& dialect_;
  const drive_profile_t& profile_;
  // Last good request on the network line: a reply does not repeat its register addresses.
  Bytes request_;
};

}  // namespace card
