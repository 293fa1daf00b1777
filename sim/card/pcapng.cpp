// SPDX-License-Identifier: Apache-2.0

#include "pcapng.h"

namespace card {

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kSectionHeader = 0x0A0D0D0A;
constexpr std::uint32_t kInterface = 1;
constexpr std::uint32_t kEnhancedPacket = 6;
constexpr std::uint32_t kByteOrderMagic = 0x1A2B3C4D;
constexpr std::uint16_t kOptionComment = 1;
constexpr std::uint16_t kOptionName = 2;   // if_name of an interface
constexpr std::uint16_t kOptionDescription = 3;
constexpr std::uint16_t kOptionFlags = 2;  // epb_flags of a packet
constexpr std::uint16_t kOptionResolution = 9;
constexpr std::uint8_t kMicroseconds = 6;
constexpr std::uint32_t kInbound = 1;
constexpr std::uint32_t kOutbound = 2;
constexpr std::uint16_t kUser0 = 147;
constexpr std::uint16_t kUser1 = 148;

void put16(Bytes& out, std::uint16_t value) {
  out.push_back(static_cast<std::uint8_t>(value));
  out.push_back(static_cast<std::uint8_t>(value >> 8));
}

void put32(Bytes& out, std::uint32_t value) {
  put16(out, static_cast<std::uint16_t>(value));
  put16(out, static_cast<std::uint16_t>(value >> 16));
}

void pad(Bytes& out) { out.resize((out.size() + 3) / 4 * 4); }

void put_option(Bytes& out, std::uint16_t code, const Bytes& value) {
  put16(out, code);
  put16(out, static_cast<std::uint16_t>(value.size()));
  out.insert(out.end(), value.begin(), value.end());
  pad(out);
}

// Link error bits of epb_flags.
std::uint32_t link_error(Flaw flaw) {
  constexpr std::uint32_t kCrc = 1u << 24, kTooLong = 1u << 25, kTooShort = 1u << 26, kWrongGap = 1u << 27,
                          kStartDelimiter = 1u << 29, kSymbol = 1u << 31;
  switch (flaw) {
    case Flaw::kNone: return 0;
    case Flaw::kRevoked:
    case Flaw::kGap: return kWrongGap;
    case Flaw::kParity:
    case Flaw::kStopBit: return kSymbol;
    case Flaw::kStart: return kStartDelimiter;
    case Flaw::kShort: return kTooShort;
    case Flaw::kLong:
    case Flaw::kLength: return kTooLong;
    default: return kCrc;
  }
}

Bytes bytes_of(const std::string& text) { return Bytes(text.begin(), text.end()); }

}  // namespace

PcapngFile::PcapngFile(const std::string& path, const SimClock& clock, const std::string& drive)
    : clock_(clock), file_(path), drive_(drive) {
  section_header();
}

void PcapngFile::network_interface(const std::string& settings) {
  network_ = interfaces_;
  settings_ = settings;
  interface(kUser0, "modbus", "network line, Modbus RTU" + (settings.empty() ? "" : ", " + settings));
}

// Delayed until the first frame: the network line's rate may be set after the file was opened.
void PcapngFile::begin(const std::string& settings) {
  if (interfaces_ > 0) return;
  network_interface(settings);
  interface(kUser1, "drive", "drive line, FC protocol, " + drive_);
}

void PcapngFile::close(const std::string& settings) {
  begin(settings);
  file_.close();
}

void PcapngFile::block(std::uint32_t type, const Bytes& body) {
  const auto length = static_cast<std::uint32_t>(body.size() + 12);
  Bytes out;
  put32(out, type);
  put32(out, length);
  out.insert(out.end(), body.begin(), body.end());
  put32(out, length);
  file_.write(out.data(), out.size());
}

void PcapngFile::section_header() {
  Bytes body;
  put32(body, kByteOrderMagic);
  put16(body, 1);  // version 1.0
  put16(body, 0);
  put32(body, 0xFFFFFFFF);  // section length not given
  put32(body, 0xFFFFFFFF);
  block(kSectionHeader, body);
}

void PcapngFile::interface(std::uint16_t link_type, const std::string& name,
                           const std::string& description) {
  Bytes body;
  put16(body, link_type);
  put16(body, 0);
  put32(body, 0);  // no limit on the captured length
  put_option(body, kOptionName, bytes_of(name));
  put_option(body, kOptionDescription, bytes_of(description));
  put_option(body, kOptionResolution, {kMicroseconds});
  put32(body, 0);  // end of options
  block(kInterface, body);
  ++interfaces_;
}

void PcapngFile::frame(const Frame& frame, const std::string& settings) {
  begin(settings);
  if (settings != settings_) network_interface(settings);
  const auto us = static_cast<std::uint64_t>(clock_.microseconds(frame.start));
  const auto length = static_cast<std::uint32_t>(frame.bytes.size());
  Bytes body;
  put32(body, frame.line == LineId::kModbus ? network_ : 1);
  put32(body, static_cast<std::uint32_t>(us >> 32));
  put32(body, static_cast<std::uint32_t>(us));
  put32(body, length);
  put32(body, length);
  body.insert(body.end(), frame.bytes.begin(), frame.bytes.end());
  pad(body);
  put_option(body, kOptionComment, bytes_of((frame.ok() ? "" : "bad frame: ") + frame.what));
  Bytes flags;
  put32(flags, (frame.sender == Sender::kCard ? kOutbound : kInbound) | link_error(frame.flaw));
  put_option(body, kOptionFlags, flags);
  put32(body, 0);  // end of options
  block(kEnhancedPacket, body);
}

}  // namespace card
