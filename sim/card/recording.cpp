// SPDX-License-Identifier: Apache-2.0

#include "recording.h"

#include <cstdio>
#include <utility>

#include "user_error.h"

namespace card {

namespace {

// Each write is flushed, so that other programs can read along. A write error, such as a full disk, is kept until
// trouble() is called.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wbe")) {
    if (file_ == nullptr) throw system_error("cannot write " + path);
  }
  ~OutputFile() { close(); }
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(const void* data, std::size_t size) {
    check(std::fwrite(data, 1, size, file_) == size);
    check(std::fflush(file_) == 0);
  }
  void close() {
    if (file_ != nullptr) check(std::fclose(std::exchange(file_, nullptr)) == 0);
  }
  const std::string& trouble() const { return trouble_; }

 private:
  void check(bool good) {
    if (!good && trouble_.empty()) trouble_ = system_error("cannot write " + path_).what();
  }

  const std::string path_;
  std::FILE* file_;
  std::string trouble_;
};

// Descriptions are plain ASCII: only the quote and the backslash need care.
std::string json_string(const std::string& plain) {
  std::string quoted = "\"";
  for (char c : plain) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}

constexpr std::uint32_t kSectionHeader = 0x0A0D0D0A;
constexpr std::uint32_t kInterface = 1;
constexpr std::uint32_t kEnhancedPacket = 6;
constexpr std::uint32_t kByteOrderMagic = 0x1A2B3C4D;
constexpr std::uint16_t kOptionComment = 1;
constexpr std::uint16_t kOptionName = 2;  // if_name of an interface
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

template <typename Value>
void put_option(Bytes& out, std::uint16_t code, const Value& value) {
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

}  // namespace

// One JSON object a line. Frames: t and end (simulated seconds: first start bit, end of the last stop bit), line,
// from, bytes, ok, what. LEDs: t, led, shows.
class JsonLog : public OutputFile {
 public:
  JsonLog(const std::string& path, const SimClock& clock) : OutputFile(path), clock_(clock) {}

  void frame(const Frame& frame) {
    line("{\"t\":" + clock_.text(frame.start) + ",\"end\":" + clock_.text(frame.end) + ",\"line\":\"" +
         line_name(frame.line) + "\",\"from\":\"" + sender_name(frame) + "\",\"bytes\":\"" + hex_text(frame.bytes) +
         "\",\"ok\":" + (frame.ok() ? "true" : "false") + ",\"what\":" + json_string(frame.what) + "}\n");
  }

  void led(const LedChange& change) {
    line("{\"t\":" + clock_.text(change.at) + ",\"led\":\"" + change.led + "\",\"shows\":\"" + change.shows +
         "\"}\n");
  }

 private:
  void line(const std::string& text) { write(text.data(), text.size()); }

  const SimClock clock_;
};

// Frames of both lines as a pcapng file with two interfaces, simulated time in microseconds.
//
// Interface 0 is the network line, link type 147 (USER0); interface 1 is the drive line, link type 148
// (USER1). sim/view/fc.lua dissects both. An interface description ends with the line's rate and format and
// with the drive's name. When the network line changes its rate, a new interface follows. Direction is the
// card's: inbound from master or drive, outbound from the card. A packet's comment is the frame's
// description and marks bad frames.
class PcapngFile : public OutputFile {
 public:
  // `drive`: name of the drive, for readers of the capture.
  PcapngFile(const std::string& path, const SimClock& clock, const std::string& drive)
      : OutputFile(path), clock_(clock), drive_(drive) {
    Bytes body;
    put32(body, kByteOrderMagic);
    put16(body, 1);  // version 1.0
    put16(body, 0);
    put32(body, 0xFFFFFFFF);  // section length not given
    put32(body, 0xFFFFFFFF);
    block(kSectionHeader, body);
  }

  // `settings`: rate and format of the network line, such as "9600 8N2"; empty: not known.
  void frame(const Frame& frame, const std::string& settings) {
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
    put_option(body, kOptionComment, (frame.ok() ? "" : "bad frame: ") + frame.what);
    Bytes flags;
    put32(flags, (frame.sender == Sender::kCard ? kOutbound : kInbound) | link_error(frame.flaw));
    put_option(body, kOptionFlags, flags);
    put32(body, 0);  // end of options
    block(kEnhancedPacket, body);
  }

  void close(const std::string& settings) {
    begin(settings);
    OutputFile::close();
  }

 private:
  // Delayed until the first frame: the network line's rate may be set after the file was opened.
  void begin(const std::string& settings) {
    if (interfaces_ > 0) return;
    network_interface(settings);
    interface(kUser1, "drive", "drive line, FC protocol, " + drive_);
  }

  void network_interface(const std::string& settings) {
    network_ = interfaces_;
    settings_ = settings;
    interface(kUser0, "modbus", "network line, Modbus RTU" + (settings.empty() ? "" : ", " + settings));
  }

  void interface(std::uint16_t link_type, const std::string& name, const std::string& description) {
    Bytes body;
    put16(body, link_type);
    put16(body, 0);
    put32(body, 0);  // no limit on the captured length
    put_option(body, kOptionName, name);
    put_option(body, kOptionDescription, description);
    put_option(body, kOptionResolution, Bytes{kMicroseconds});
    put32(body, 0);  // end of options
    block(kInterface, body);
    ++interfaces_;
  }

  void block(std::uint32_t type, const Bytes& body) {
    const auto length = static_cast<std::uint32_t>(body.size() + 12);
    Bytes out;
    put32(out, type);
    put32(out, length);
    out.insert(out.end(), body.begin(), body.end());
    put32(out, length);
    write(out.data(), out.size());
  }

  const SimClock clock_;
  const std::string drive_;
  std::string settings_;
  std::uint32_t interfaces_ = 0;  // number written
  std::uint32_t network_ = 0;     // current interface of the network line
};

Recording::Recording(const SimClock& clock, const Describer& describer, const std::string& log_file,
                     const std::string& pcap_file)
    : describer_(describer) {
  if (!log_file.empty()) log_ = std::make_unique<JsonLog>(log_file, clock);
  if (!pcap_file.empty()) pcap_ = std::make_unique<PcapngFile>(pcap_file, clock, describer.drive_name());
}

Recording::~Recording() = default;

void Recording::listen(std::function<void(const Frame&)> frames, std::function<void(const LedChange&)> leds) {
  on_frame_ = std::move(frames);
  on_led_ = std::move(leds);
}

void Recording::frame(const Frame& seen) {
  waiting_.emplace(seen.start, [this, frame = seen, settings = settings_]() mutable {
    describer_.describe(frame);
    if (log_) log_->frame(frame);
    if (pcap_) pcap_->frame(frame, settings);
    if (on_frame_) on_frame_(frame);
  });
}

void Recording::led(const LedChange& change) {
  waiting_.emplace(change.at, [this, change] {
    if (log_) log_->led(change);
    if (on_led_) on_led_(change);
  });
}

void Recording::write_until(Cycles settled) {
  while (!waiting_.empty() && waiting_.begin()->first <= settled) {
    waiting_.begin()->second();
    waiting_.erase(waiting_.begin());
  }
}

void Recording::close() {
  write_until(kNever);
  if (log_) log_->close();
  if (pcap_) pcap_->close(settings_);
}

std::string Recording::trouble() const {
  if (log_ && !log_->trouble().empty()) return log_->trouble();
  return pcap_ ? pcap_->trouble() : "";
}

}  // namespace card
