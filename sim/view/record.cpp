// SPDX-License-Identifier: Apache-2.0
// Writes --log and --pcap for test benches in the virtual card's format, from bytes and LED levels. A C
// interface for ctypes (tb/lib/recording.py). Times in ns of simulated time. For one thread: nothing is locked.

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string>

#include "recording.h"
#include "user_error.h"

namespace {

using namespace card;

constexpr SimClock kClock{1'000'000'000};
// A character is reported at its end: at 300 bit/s it began this long ago.
constexpr Cycles kLongestCharacter = 40'000'000;

struct Recorder {
  Recorder(const Describer& describer, const std::string& log, const std::string& pcap)
      : recording(kClock, describer, log, pcap),
        lines{FrameGrouper(LineId::kModbus, {}, [this](const Frame& f) { recording.frame(f); }),
              FrameGrouper(LineId::kDrive, {}, [this](const Frame& f) { recording.frame(f); })},
        leds{LedWatch("modbus", kClock, [this](const LedChange& c) { recording.led(c); }),
             LedWatch("drive", kClock, [this](const LedChange& c) { recording.led(c); })} {}

  void write(Cycles now) {
    Cycles settled = now - kLongestCharacter;
    for (const FrameGrouper& line : lines) settled = std::min(settled, line.open_since());
    for (const LedWatch& led : leds) settled = std::min(settled, led.undecided_since());
    recording.write_until(settled);
  }

  Recording recording;
  std::array<FrameGrouper, 2> lines;  // by LineId
  std::array<LedWatch, 2> leds;
};

}  // namespace

extern "C" {

// Returns NULL on failure, with the reason in `error`.
void* record_open(const char* log, const char* pcap, const char* dialect, char* error, unsigned error_size) {
  try {
    const Dialect* const words_of = find_dialect(dialect);
    if (words_of == nullptr) throw UserError(std::string("no dialect ") + dialect);
    return new Recorder(Describer(*words_of, *drive_profile(words_of->profile)), log, pcap);
  } catch (const UserError& wrong) {
    std::snprintf(error, error_size, "%s", wrong.what());
    return nullptr;
  }
}

// `line`: 0 network, 1 drive. `inside`: longest silence inside a frame; `between`: silence that ends a frame.
void record_silences(void* recorder, int line, long long inside, long long between, long long character) {
  static_cast<Recorder*>(recorder)
      ->lines.at(static_cast<std::size_t>(line))
      .use(Silences{inside, between, character});
}

// Rate and format of the network line, such as "9600 8N2".
void record_network_line(void* recorder, const char* settings) {
  static_cast<Recorder*>(recorder)->recording.network_line(settings);
}

void record_byte(void* recorder, int line, int from_card, int value, int bad_parity, int bad_stop,
                 long long start, long long end) {
  auto& self = *static_cast<Recorder*>(recorder);
  self.lines.at(static_cast<std::size_t>(line))
      .add(LineByte{from_card != 0 ? Sender::kCard : Sender::kFarEnd, static_cast<std::uint8_t>(value),
                    bad_parity != 0, bad_stop != 0, start, end});
}

// The line is silent: ends the frame.
void record_end_frame(void* recorder, int line) {
  static_cast<Recorder*>(recorder)->lines.at(static_cast<std::size_t>(line)).flush();
}

// Levels of an LED, 0 network, 1 drive; call every few milliseconds so that flashing is recognised.
void record_led(void* recorder, int led, int red, int green, long long now) {
  const unsigned colour = (red != 0 ? 1u : 0u) | (green != 0 ? 2u : 0u);
  static_cast<Recorder*>(recorder)->leds.at(static_cast<std::size_t>(led)).sample(colour, now);
}

// Writes all events that no later event can precede.
void record_write(void* recorder, long long now) { static_cast<Recorder*>(recorder)->write(now); }

// Returns whether everything was written; if not, the reason is in `error`.
int record_close(void* recorder, char* error, unsigned error_size) {
  const std::unique_ptr<Recorder> self(static_cast<Recorder*>(recorder));
  for (FrameGrouper& line : self->lines) line.flush();
  self->recording.close();
  const std::string trouble = self->recording.trouble();
  std::snprintf(error, error_size, "%s", trouble.c_str());
  return trouble.empty();
}

}  // extern "C"
