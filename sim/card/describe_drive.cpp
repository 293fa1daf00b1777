// SPDX-License-Identifier: Apache-2.0
// FC protocol telegrams in words (FC-1 to FC-7).

#include "describe.h"

namespace card {

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t kStx = 0x02;
constexpr std::size_t kLge = 1;       // index of LGE in a telegram
constexpr std::size_t kNotInLge = 2;  // STX and LGE itself
constexpr std::size_t kShortest = 8;  // process telegram
constexpr std::size_t kParameter = 16;
constexpr std::size_t kAroundText = 12;  // length of a text telegram without its text
constexpr std::size_t kData = 3;         // index of the first data byte
constexpr double kFullScale = 16384.0;   // 4000h = 100 %
constexpr std::size_t kPke = kData;
constexpr std::size_t kInd = kData + 2;
constexpr std::size_t kPwe = kData + 4;

enum Request {
  kNone,
  kRead,
  kWriteWord,
  kWriteDouble,
  kWriteDoubleEeprom = 13,
  kWriteWordEeprom = 14,
  kText = 15
};
enum Reply { kWordValue = 1, kDoubleValue = 2, kRefused = 7 };

// Both address formats: 80h, or bit 5 of a byte without bit 7.
bool is_broadcast(std::uint8_t adr) { return adr == 0x80 || (adr & 0xA0) == 0x20; }

std::string process(const Bytes& telegram, std::size_t at, bool reply) {
  return text(reply ? "status %04Xh, frequency %04Xh" : "control %04Xh, reference %04Xh", word(telegram, at),
              word(telegram, at + 2));
}

std::string index_words(unsigned index) { return (index & 0xFF) == 0 ? "" : text(" index %u", index & 0xFF); }

std::string request_words(const Words& words, const Bytes& telegram, const std::string& name) {
  const std::uint32_t value = word(telegram, kPwe) * 65536u + word(telegram, kPwe + 2);
  const unsigned ak = word(telegram, kPke) >> 12;
  const unsigned pnu = words.pnu(word(telegram, kPke));
  switch (ak) {
    case kNone: return "no parameter";
    case kRead: return "read " + name;
    case kWriteWord:
    case kWriteDouble: return "write " + name + " = " + words.parameter_value(pnu, value);
    case kWriteDoubleEeprom:
    case kWriteWordEeprom:
      return "write " + name + " = " + words.parameter_value(pnu, value) + ", RAM and EEPROM";
    case kText:
      if (word(telegram, kInd) >> 8 == 4) return "read text of " + name;
      return "write text of " + name + " = " + quoted(telegram.data() + kPwe, telegram.size() - kAroundText);
    default: return text("task %u for ", ak) + name;
  }
}

std::string reply_words(const Words& words, const Bytes& telegram, const std::string& name) {
  const std::uint32_t value = word(telegram, kPwe) * 65536u + word(telegram, kPwe + 2);
  const unsigned ak = word(telegram, kPke) >> 12;
  const unsigned pnu = words.pnu(word(telegram, kPke));
  switch (ak) {
    case kNone: return "no parameter";
    case kWordValue:
    case kDoubleValue: return name + " = " + words.parameter_value(pnu, value);
    case kRefused:
      return name + text(" refused, fault %u: ", value & 0xFFFF) + fault_name(value & 0xFFFF);
    case kText: return name + " = " + quoted(telegram.data() + kPwe, telegram.size() - kAroundText);
    default: return text("answer %u for ", ak) + name;
  }
}

}  // namespace

void Describer::drive(Frame& frame) const {
  const Bytes& telegram = frame.bytes;
  const std::size_t length = telegram.size() > kLge ? telegram[kLge] + kNotInLge : kShortest;
  std::uint8_t bcc = 0;
  for (std::uint8_t byte : telegram) bcc = static_cast<std::uint8_t>(bcc ^ byte);
  if (frame.bad_byte != 0) {
    frame.flaw = frame.bad_parity ? Flaw::kParity : Flaw::kStopBit;
    frame.what = bad_byte(frame);
  } else if (telegram[0] != kStx) {
    frame.flaw = Flaw::kStart;
    frame.what = "no STX";
  } else if (telegram.size() < length) {
    frame.flaw = Flaw::kGap;
    frame.what = text("gap: silence after %zu of %zu bytes", telegram.size(), length);
  } else if (telegram.size() > length || length < kShortest) {
    frame.flaw = Flaw::kLength;
    frame.what = "LGE does not fit the length";
  } else if (bcc != 0) {
    frame.flaw = Flaw::kCheck;
    frame.what = "BCC wrong";
  }
  if (!frame.ok()) return;
  const bool reply = frame.sender == Sender::kFarEnd;
  frame.what = is_broadcast(telegram[2]) ? "to all: " : "";
  if (telegram.size() == kShortest) {
    const auto second = static_cast<std::int16_t>(word(telegram, kData + 2));
    frame.what += process(telegram, kData, reply) + text(" (%.1f %%)", 100.0 * second / kFullScale);
  } else if (telegram.size() < kAroundText) {
    frame.what += "unknown kind of telegram";
  } else {
    const unsigned pke = word(telegram, kPke);
    const std::string name = words_.parameter_name(words_.pnu(pke)) + index_words(word(telegram, kInd));
    const bool is_text = pke >> 12 == kText;
    if (telegram.size() != kParameter && !is_text) {
      frame.what += "parameter telegram of a wrong length";
      return;
    }
    frame.what += reply ? reply_words(words_, telegram, name) : request_words(words_, telegram, name);
    frame.what += "; " + process(telegram, telegram.size() - 5, reply);
  }
}

}  // namespace card
