// SPDX-License-Identifier: Apache-2.0

#include "describe.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "fc_words.h"

namespace card {

namespace {

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

constexpr std::uint8_t kStx = 0x02;
constexpr std::size_t kLge = 1;       // index of LGE in a telegram
constexpr std::size_t kNotInLge = 2;  // STX and LGE itself
constexpr std::size_t kProcess = 8;   // length of a process telegram, the shortest
constexpr std::size_t kParameter = 16;
constexpr std::size_t kAroundText = 12;  // length of a text telegram without its text
constexpr std::size_t kPke = 3;          // index of the first data byte
constexpr std::size_t kInd = kPke + 2;
constexpr std::size_t kPwe = kPke + 4;
constexpr unsigned kTextRead = 4;       // high byte of IND
constexpr double kFullScale = 16384.0;  // 4000h = 100 %

enum Request { kNone, kRead, kWriteWord, kWriteDouble, kWriteDoubleEeprom = 13, kWriteWordEeprom = 14, kText = 15 };
enum Reply { kWordValue = 1, kDoubleValue = 2, kRefused = 7 };

// printf into a std::string.
__attribute__((format(printf, 1, 2))) std::string text(const char* format, ...) {
  char buffer[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

// Two bytes, high byte first.
unsigned word(const Bytes& bytes, std::size_t at) { return static_cast<unsigned>(bytes[at] << 8 | bytes[at + 1]); }
std::uint32_t double_word(const Bytes& bytes, std::size_t at) {
  return word(bytes, at) * 65536u + word(bytes, at + 2);
}

// Characters in quotes, a dot for each that cannot be printed.
std::string quoted(const std::uint8_t* bytes, std::size_t count) {
  std::string words = "'";
  for (std::size_t i = 0; i < count; ++i)
    words += bytes[i] >= 0x20 && bytes[i] < 0x7F ? static_cast<char>(bytes[i]) : '.';
  return words + "'";
}

// Fault numbers of the drive, which most dialects pass on as exception codes.
const char* fault_name(unsigned number) {
  for (const fc_words::Fault& fault : fc_words::kFaults)
    if (fault.number == number) return fault.name;
  return "other fault of the drive";
}

void spoil(Frame& frame, Flaw flaw, const std::string& what) {
  frame.flaw = flaw;
  frame.what = what;
}

void spoil_by_byte(Frame& frame) {
  spoil(frame, frame.bad_parity ? Flaw::kParity : Flaw::kStopBit,
        text("%s wrong in byte %zu", frame.bad_parity ? "parity" : "stop bit", frame.bad_byte));
}

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

std::string process_words(const Bytes& telegram, std::size_t at, bool reply) {
  return text(reply ? "status %04Xh, frequency %04Xh" : "control %04Xh, reference %04Xh", word(telegram, at),
              word(telegram, at + 2));
}

}  // namespace

bool complete_adu(const Bytes& bytes) {
  const std::size_t size = bytes.size();
  return size >= kShortestAdu && size <= kLongestAdu &&
         crc16(bytes, size - 2) == (bytes[size - 2] | bytes[size - 1] << 8);
}

// ---------------------------------------------------------------- parameters and exceptions

const drive_parameter_t* Describer::find(unsigned pnu) const {
  for (unsigned i = 0; i < profile_.count; ++i)
    if (profile_.parameters[i].pnu == pnu) return &profile_.parameters[i];
  return nullptr;
}

std::string Describer::parameter_name(unsigned pnu) const {
  const drive_parameter_t* parameter = find(pnu);
  return text("parameter %u", pnu) + (parameter == nullptr ? "" : std::string(" (") + parameter->name + ")");
}

bool Describer::is_text(unsigned pnu) const {
  const drive_parameter_t* parameter = find(pnu);
  return parameter != nullptr && parameter->type == DRIVE_TEXT;
}

std::string Describer::parameter_value(unsigned pnu, std::uint32_t value) const {
  const drive_parameter_t* parameter = find(pnu);
  if (parameter == nullptr) return text("%u", value);
  std::int64_t number = value;
  if (parameter->type == DRIVE_INT16) number = static_cast<std::int16_t>(value);
  if (parameter->type == DRIVE_INT32) number = static_cast<std::int32_t>(value);
  const std::string raw = std::to_string(number);
  const std::string unit = parameter->unit[0] == '\0' ? "" : std::string(" ") + parameter->unit;
  const int conversion = parameter->conversion;
  if (conversion >= 0 || conversion <= -6) return raw + unit;
  return raw + text(" (%.*f%s)", -conversion, static_cast<double>(number) * std::pow(10.0, conversion), unit.c_str());
}

const char* Describer::exception_name(unsigned code) const {
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

// ---------------------------------------------------------------- Modbus RTU: coils and registers (MAP-1 to MAP-9)

// Names registers by their address: 40001-40009 by number, others by parameter (PNU x 10 - 1). Too many for
// a number are counted: a master that merges reads.
std::string Describer::registers(unsigned address, unsigned count) const {
  if (address < kLocalRegisters) return range("register", 40001 + address, count);
  const unsigned pnu = (address + 1) / 10;
  if ((address + 1) % 10 == 0) {
    const bool many = count > kNumericRegisters && !is_text(pnu);
    return parameter_name(pnu) + (many ? text(", %u registers", count) : "");
  }
  return range("register", 40001 + address, count) + " (no parameter starts there)";
}

std::string Describer::register_values(const Bytes& adu, std::size_t at, unsigned address, unsigned count) const {
  if (at + 2 * count + 2 > adu.size()) return "?";
  if (address < kLocalRegisters) {
    std::string values;
    for (unsigned i = 0; i < count; ++i) values += text(i == 0 ? "%04Xh" : " %04Xh", word(adu, at + 2 * i));
    return values;
  }
  const unsigned pnu = (address + 1) / 10;
  if (count > kNumericRegisters || is_text(pnu)) return quoted(adu.data() + at, 2 * count);
  return parameter_value(pnu, count == 2 ? double_word(adu, at) : word(adu, at));
}

std::string Describer::modbus_request(const Bytes& adu) const {
  const unsigned address = word(adu, 2);
  const unsigned count = word(adu, 4);
  switch (adu[1]) {
    case kReadCoils: return "read " + coils(address, count);
    case kReadRegisters: return "read " + registers(address, count);
    case kWriteCoil: return "write " + coils(address, 1) + " = " + switch_value(count);
    case kWriteRegister: return "write " + registers(address, 1) + " = " + register_values(adu, 4, address, 1);
    case kWriteCoils: return "write " + coils(address, count) + " = " + coil_values(adu, 7, count);
    case kWriteRegisters:
      return "write " + registers(address, count) + " = " + register_values(adu, 7, address, count);
    default: return text("function %02Xh", adu[1]);
  }
}

std::string Describer::modbus_reply(const Bytes& adu) const {
  if ((adu[1] & kException) != 0) return text("exception %u: ", adu[2]) + exception_name(adu[2]);
  if (request_.size() < 8 || request_[1] != adu[1]) return text("reply to function %02Xh", adu[1]);
  const unsigned address = word(request_, 2);
  const unsigned count = word(request_, 4);
  if (adu[1] == kReadCoils && adu.size() >= 6) return coils(address, count) + " = " + coil_values(adu, 3, count);
  if (adu[1] == kReadRegisters && adu.size() >= 7)
    return registers(address, count) + " = " + register_values(adu, 3, address, count);
  return "write done";
}

void Describer::modbus(Frame& frame) {
  const Bytes& adu = frame.bytes;
  if (frame.revoked())
    return spoil(frame, Flaw::kRevoked,
                 text("revoked: good after %zu bytes, but %.2f characters later the next one began", frame.gap_at,
                      frame.gap_characters));
  if (frame.bad_byte != 0) return spoil_by_byte(frame);
  if (!complete_adu(adu)) {
    if (frame.gap_characters > 0)
      return spoil(frame, Flaw::kGap,
                   text("gap: not complete after %zu bytes, then %.2f characters of silence", frame.gap_at,
                        frame.gap_characters));
    if (adu.size() < kShortestAdu) return spoil(frame, Flaw::kShort, "too short for a frame");
    if (adu.size() > kLongestAdu) return spoil(frame, Flaw::kLong, "too long for a frame");
    return spoil(frame, Flaw::kCheck, "CRC wrong");
  }
  if (frame.sender == Sender::kCard) {
    frame.what = unit(adu[0]) + modbus_reply(adu);
    return;
  }
  const bool whole = adu.size() >= 8;
  frame.what = unit(adu[0]) + (whole ? modbus_request(adu) + length_flaw(adu)
                                     : text("function %02Xh, %zu bytes", adu[1], adu.size()));
  request_ = adu;
}

// ---------------------------------------------------------------- FC protocol (FC-1 to FC-7)

std::string Describer::parameter_words(const Bytes& telegram, bool reply) const {
  const unsigned ak = word(telegram, kPke) >> 12;
  const unsigned pnu = word(telegram, kPke) & profile_.pnu_mask;
  const unsigned index = telegram[kInd + 1];
  const std::string name = parameter_name(pnu) + (index == 0 ? "" : text(" index %u", index));
  const std::string number = name + " = " + parameter_value(pnu, double_word(telegram, kPwe));
  if (ak == kNone) return "no parameter";
  if (ak == kText && !reply && telegram[kInd] == kTextRead) return "read text of " + name;
  if (ak == kText)
    return (reply ? "" : "write text of ") + name + " = " +
           quoted(telegram.data() + kPwe, telegram.size() - kAroundText);
  const unsigned fault = word(telegram, kPwe + 2);
  if (reply && ak == kRefused) return name + text(" refused, fault %u: ", fault) + fault_name(fault);
  if (reply) return ak == kWordValue || ak == kDoubleValue ? number : text("answer %u for ", ak) + name;
  switch (ak) {
    case kRead: return "read " + name;
    case kWriteWord:
    case kWriteDouble: return "write " + number;
    case kWriteDoubleEeprom:
    case kWriteWordEeprom: return "write " + number + ", RAM and EEPROM";
    default: return text("task %u for ", ak) + name;
  }
}

std::string Describer::telegram_words(const Bytes& telegram, bool reply) const {
  if (telegram.size() == kProcess) {
    const auto second = static_cast<std::int16_t>(word(telegram, kPke + 2));
    return process_words(telegram, kPke, reply) + text(" (%.1f %%)", 100.0 * second / kFullScale);
  }
  if (telegram.size() < kAroundText) return "unknown kind of telegram";
  if (telegram.size() != kParameter && word(telegram, kPke) >> 12 != kText)
    return "parameter telegram of a wrong length";
  return parameter_words(telegram, reply) + "; " + process_words(telegram, telegram.size() - 5, reply);
}

void Describer::drive(Frame& frame) const {
  const Bytes& telegram = frame.bytes;
  const std::size_t length = telegram.size() > kLge ? telegram[kLge] + kNotInLge : kProcess;
  std::uint8_t bcc = 0;
  for (std::uint8_t byte : telegram) bcc = static_cast<std::uint8_t>(bcc ^ byte);
  if (frame.bad_byte != 0) return spoil_by_byte(frame);
  if (telegram[0] != kStx) return spoil(frame, Flaw::kStart, "no STX");
  if (telegram.size() < length)
    return spoil(frame, Flaw::kGap, text("gap: silence after %zu of %zu bytes", telegram.size(), length));
  if (telegram.size() > length || length < kProcess)
    return spoil(frame, Flaw::kLength, "LGE does not fit the length");
  if (bcc != 0) return spoil(frame, Flaw::kCheck, "BCC wrong");
  // Both address formats: 80h, or bit 5 of a byte without bit 7.
  const bool to_all = telegram[2] == 0x80 || (telegram[2] & 0xA0) == 0x20;
  frame.what = (to_all ? "to all: " : "") + telegram_words(telegram, frame.sender == Sender::kFarEnd);
}

void Describer::describe(Frame& frame) {
  if (frame.line == LineId::kModbus) {
    modbus(frame);
  } else {
    drive(frame);
  }
}

}  // namespace card
