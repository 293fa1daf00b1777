// SPDX-License-Identifier: Apache-2.0
// Modbus RTU in the card's terms: coils and registers (MAP-1 to MAP-9), exceptions (EXC).

#include <cstdio>

#include "describe.h"

namespace card {

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kShortestAdu = 4;
constexpr std::size_t kLongestAdu = 256;
constexpr unsigned kLocalRegisters = 9;    // 40001-40009, in use or reserved
constexpr unsigned kNumericRegisters = 2;  // a parameter with more registers is a text

enum Function : std::uint8_t {
  kReadCoils = 0x01,
  kReadRegisters = 0x03,
  kWriteCoil = 0x05,
  kWriteRegister = 0x06,
  kWriteCoils = 0x0F,
  kWriteRegisters = 0x10,
  kException = 0x80,
};

std::uint16_t crc16(const Bytes& bytes, std::size_t count) {
  std::uint16_t crc = 0xFFFF;
  for (std::size_t i = 0; i < count; ++i) {
    crc = static_cast<std::uint16_t>(crc ^ bytes[i]);
    for (int bit = 0; bit < 8; ++bit)
      crc = static_cast<std::uint16_t>((crc & 1) != 0 ? (crc >> 1) ^ 0xA001 : crc >> 1);
  }
  return crc;
}

std::string range(const char* what, unsigned first, unsigned count) {
  if (count == 1) return text("%s %u", what, first);
  return text("%ss %u-%u", what, first, first + count - 1);
}

// Names registers by their address: 40001-40009 by number, others by parameter (PNU x 10 - 1). Too many for
// a number are counted: a master that merges reads.
std::string registers(const Words& words, unsigned address, unsigned count) {
  if (address < kLocalRegisters) return range("register", 40001 + address, count);
  const unsigned pnu = (address + 1) / 10;
  if ((address + 1) % 10 == 0) {
    const bool many = count > kNumericRegisters && !words.is_text(pnu);
    return words.parameter_name(pnu) + (many ? text(", %u registers", count) : "");
  }
  return range("register", 40001 + address, count) + " (no parameter starts there)";
}

std::string coils(unsigned address, unsigned count) {
  std::string words = range("coil", address + 1, count);
  if (address == 0 && count == 16) return words + " (control word)";
  if (address == 16 && count == 16) return words + " (reference)";
  if (address == 32 && count == 16) return words + " (status word)";
  if (address == 48 && count == 16) return words + " (output frequency)";
  if (address == 64 && count == 1) return words + " (write to EEPROM)";
  return words;
}

// Packed coils, first coil in bit 0 of the first byte.
std::string coil_values(const Bytes& adu, std::size_t at, unsigned count) {
  if (at + (count + 7) / 8 + 2 > adu.size()) return "?";
  if (count == 1) return (adu[at] & 1) != 0 ? "on" : "off";
  std::string words;
  for (unsigned done = 0; done < count; done += 16, at += 2) {
    const bool whole = count - done > 8;
    words += words.empty() ? "" : " ";
    words += whole ? text("%02X%02Xh", adu[at + 1], adu[at]) : text("%02Xh", adu[at]);
  }
  return words;
}

std::string register_values(const Words& words, const Bytes& adu, std::size_t at, unsigned address,
                            unsigned count) {
  if (at + 2 * count + 2 > adu.size()) return "?";
  if (address < kLocalRegisters) {
    std::string values;
    for (unsigned i = 0; i < count; ++i) values += text(i == 0 ? "%04Xh" : " %04Xh", word(adu, at + 2 * i));
    return values;
  }
  const unsigned pnu = (address + 1) / 10;
  if (count > kNumericRegisters || words.is_text(pnu)) return quoted(adu.data() + at, 2 * count);
  if (count == 2) return words.parameter_value(pnu, word(adu, at) * 65536u + word(adu, at + 2));
  return words.parameter_value(pnu, word(adu, at));
}

std::string switch_value(unsigned data) {
  if (data == 0xFF00) return "on";
  return data == 0 ? "off" : text("%04Xh", data);
}

// States the correct length: the description of a request does not show a wrong one.
std::string length_flaw(const Bytes& adu) {
  const bool has_data = adu[1] == kWriteCoils || adu[1] == kWriteRegisters;
  const bool known = has_data || (adu[1] >= kReadCoils && adu[1] <= kWriteRegister);
  const std::size_t right = has_data ? 9u + adu[6] : 8u;
  if (known && adu.size() != right) return text(" (%zu bytes, %zu would be right)", adu.size(), right);
  const unsigned count = word(adu, 4);
  const unsigned data = adu[1] == kWriteCoils ? (count + 7) / 8 : 2 * count;
  return has_data && adu[6] != data ? text(" (byte count %u, %u would be right)", adu[6], data) : "";
}

std::string unit(std::uint8_t address) { return address == 0 ? "to all: " : text("unit %u: ", address); }

}  // namespace

bool complete_adu(const Bytes& bytes) {
  const std::size_t size = bytes.size();
  return size >= kShortestAdu && size <= kLongestAdu &&
         crc16(bytes, size - 2) == (bytes[size - 2] | bytes[size - 1] << 8);
}

std::string bad_byte(const Frame& frame) {
  return text("%s wrong in byte %zu", frame.bad_parity ? "parity" : "stop bit", frame.bad_byte);
}

std::string Describer::modbus_request(const Bytes& adu) const {
  if (adu.size() < 8) return unit(adu[0]) + text("function %02Xh, %zu bytes", adu[1], adu.size());
  return unit(adu[0]) + modbus_asked(adu) + length_flaw(adu);
}

std::string Describer::modbus_asked(const Bytes& adu) const {
  const unsigned address = word(adu, 2);
  const unsigned count = word(adu, 4);
  switch (adu[1]) {
    case kReadCoils: return "read " + coils(address, count);
    case kReadRegisters: return "read " + registers(words_, address, count);
    case kWriteCoil: return "write " + coils(address, 1) + " = " + switch_value(count);
    case kWriteRegister:
      return "write " + registers(words_, address, 1) + " = " +
             register_values(words_, adu, 4, address, 1);
    case kWriteCoils: return "write " + coils(address, count) + " = " + coil_values(adu, 7, count);
    case kWriteRegisters:
      return "write " + registers(words_, address, count) + " = " +
             register_values(words_, adu, 7, address, count);
    default: return text("function %02Xh", adu[1]);
  }
}

std::string Describer::modbus_reply(const Bytes& adu) const {
  const std::string from = unit(adu[0]);
  if ((adu[1] & kException) != 0)
    return from + text("exception %u: ", adu[2]) + words_.exception_name(adu[2]);
  const bool known = request_.size() >= 8 && request_[1] == adu[1];
  const unsigned address = known ? word(request_, 2) : 0;
  const unsigned count = known ? word(request_, 4) : 0;
  if (known && adu[1] == kReadCoils && adu.size() >= 6)
    return from + coils(address, count) + " = " + coil_values(adu, 3, count);
  if (known && adu[1] == kReadRegisters && adu.size() >= 7)
    return from + registers(words_, address, count) + " = " +
           register_values(words_, adu, 3, address, count);
  if (known && (adu[1] & kException) == 0) return from + "write done";
  return from + text("reply to function %02Xh", adu[1]);
}

Flaw Describer::modbus_flaw(const Frame& frame) const {
  if (frame.revoked()) return Flaw::kRevoked;
  if (frame.bad_byte != 0) return frame.bad_parity ? Flaw::kParity : Flaw::kStopBit;
  if (complete_adu(frame.bytes)) return Flaw::kNone;
  if (frame.gap_characters > 0) return Flaw::kGap;
  if (frame.bytes.size() < kShortestAdu) return Flaw::kShort;
  return frame.bytes.size() > kLongestAdu ? Flaw::kLong : Flaw::kCheck;
}

void Describer::modbus(Frame& frame) {
  const Bytes& adu = frame.bytes;
  frame.flaw = modbus_flaw(frame);
  switch (frame.flaw) {
    case Flaw::kRevoked:
      frame.what = text("revoked: good after %zu bytes, but %.2f characters later the next one began",
                        frame.gap_at, frame.gap_characters);
      return;
    case Flaw::kParity:
    case Flaw::kStopBit: frame.what = bad_byte(frame); return;
    case Flaw::kGap:
      frame.what = text("gap: not complete after %zu bytes, then %.2f characters of silence", frame.gap_at,
                        frame.gap_characters);
      return;
    case Flaw::kShort: frame.what = "too short for a frame"; return;
    case Flaw::kLong: frame.what = "too long for a frame"; return;
    case Flaw::kNone: break;
    default: frame.what = "CRC wrong"; return;
  }
  if (frame.sender == Sender::kCard) {
    frame.what = modbus_reply(adu);
  } else {
    frame.what = modbus_request(adu);
    request_ = adu;
  }
}

void Describer::describe(Frame& frame) {
  if (frame.line == LineId::kModbus) {
    modbus(frame);
  } else {
    drive(frame);
  }
}

}  // namespace card
