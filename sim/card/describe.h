// SPDX-License-Identifier: Apache-2.0
// Describes the frames of both lines in words, for log and terminal, and checks them.

#ifndef DESCRIBE_H
#define DESCRIBE_H

#include <cstdint>
#include <vector>

#include "frame.h"
#include "words.h"

namespace card {

// Whether bytes are a whole Modbus RTU frame: length and CRC.
bool complete_adu(const std::vector<std::uint8_t>& bytes);

// "parity wrong in byte 3"
std::string bad_byte(const Frame& frame);

class Describer {
 public:
  explicit Describer(const Words& words) : words_(words) {}
  const char* drive() const { return words_.drive(); }
  // Fills frame.flaw and frame.what.
  void describe(Frame& frame);

 private:
  Flaw modbus_flaw(const Frame& frame) const;
  std::string modbus_request(const std::vector<std::uint8_t>& adu) const;
  std::string modbus_asked(const std::vector<std::uint8_t>& adu) const;
  std::string modbus_reply(const std::vector<std::uint8_t>& adu) const;
  void modbus(Frame& frame);
  void drive(Frame& frame) const;

  const Words words_;
  // Last good request on the network line: a reply does not repeat its register addresses.
  std::vector<std::uint8_t> request_;
};

}  // namespace card

#endif
