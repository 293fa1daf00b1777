// SPDX-License-Identifier: Apache-2.0

#include "uart_line.h"

#include <cmath>
#include <utility>

#include "card_tables.h"

namespace card {

namespace {
// Characters added to the required silence, so that the next frame is certain to count as new.
constexpr double kExtraCharacters = 0.5;

constexpr int kFirstDataBit = 1;
constexpr unsigned kThousand = 1000;
constexpr int kAfterData = 9;  // parity bit, or first stop bit without parity

Cycles ticks(int count, int baud, const SimClock& clock) {
  return clock.bit_parts(count, card_tables::kTicksPerBit, baud);
}

// `silence`: in ticks, before a new burst.
LineSettings line_settings(int baud, const card_tables::Format& format, int silence, const SimClock& clock) {
  const int extra = static_cast<int>(kExtraCharacters * format.character_bits * card_tables::kTicksPerBit);
  return {baud, format.parity, format.stop_bits, {}, ticks(silence + extra, baud, clock)};
}

}  // namespace

std::string LineSettings::name() const {
  return std::to_string(baud) + " 8" + parity + std::to_string(stop_bits);
}

LineSettings network_settings(unsigned sw_baud, const SimClock& clock) {
  const auto& lines = CARD_EXTENDED_SWITCHES ? card_tables::kExtendedLine : card_tables::kLine;
  const card_tables::Line& set = lines[sw_baud & 31];
  LineSettings line = line_settings(set.baud, set.format, set.t35_ticks, clock);
  const Cycles t35 = ticks(set.t35_ticks, line.baud, clock);
  line.silences = {ticks(set.t15_ticks, line.baud, clock), t35, t35 * 2 / 7};
  return line;
}

LineSettings drive_settings(const SimClock& clock) {
  using namespace card_tables;
  LineSettings line = line_settings(kDriveBaud, kDriveFormat, kDrivePauseTicks, clock);
  // The pause before a telegram is also the longest gap FC-8 allows inside one.
  const Cycles pause = ticks(kDrivePauseTicks, line.baud, clock);
  line.silences = {pause, pause, pause / 2};
  return line;
}

UartLine::UartLine(const SimClock& clock, const LineSettings& settings, Listener listener)
    : clock_(clock), settings_(settings), listener_(std::move(listener)) {}

bool UartLine::parity_bit(std::uint8_t value) const {
  const bool odd_ones = __builtin_parity(value) != 0;
  return settings_.parity == 'O' ? !odd_ones : odd_ones;
}

Cycles UartLine::far_bit_edge(Cycles start, int bit) const {
  if (trouble_.baud_error == 0) return bit_edge(start, bit);
  return start + static_cast<Cycles>(std::llround(bit * static_cast<double>(clock_.hz) / settings_.baud /
                                                  (1 + trouble_.baud_error / 100)));
}

// Picks a data or parity bit of the next byte, or -1.
int UartLine::bit_to_flip() {
  if (trouble_.noise == 0 || static_cast<int>(noise_() % kThousand) >= trouble_.noise) return -1;
  return kFirstDataBit + static_cast<int>(noise_() % (settings_.parity == 'N' ? 8u : 9u));
}

void UartLine::send(const Bytes& bytes, Cycles now) {
  tx_queue_.insert(tx_queue_.end(), bytes.begin(), bytes.end());
  if (!far_end_sending() && !tx_queue_.empty()) {
    tx_start_ = now;
    tx_bit_ = 0;
    tx_due_ = now;
  }
}

void UartLine::run(Cycles now) {
  // One pass does one step of each direction; a due time in the past comes back through next_event().
  if (tx_due_ <= now) next_tx_bit(now);
  if (rx_due_ <= now) sample_rx_bit();
}

void UartLine::next_tx_bit(Cycles now) {
  if (tx_bit_ == settings_.char_bits()) {
    const bool flipped = tx_flip_ >= 0;
    const unsigned mask = flipped && tx_flip_ < kAfterData ? 1u << (tx_flip_ - kFirstDataBit) : 0u;
    const LineByte done{Sender::kFarEnd,
                        static_cast<std::uint8_t>(tx_queue_.front() ^ mask),
                        flipped && settings_.parity != 'N',
                        false,
                        tx_start_,
                        now};
    tx_queue_.pop_front();
    traffic_until(now);
    tx_bit_ = tx_queue_.empty() ? -1 : 0;
    tx_start_ = now;
    tx_due_ = tx_queue_.empty() ? kNever : now;
    if (!trouble_.cut) listener_(done);
    if (tx_bit_ < 0) return;
  }
  const std::uint8_t value = tx_queue_.front();
  if (tx_bit_ == 0) {
    tx_flip_ = bit_to_flip();
    far_level_ = false;
  } else if (tx_bit_ < kAfterData) {
    far_level_ = (value >> (tx_bit_ - kFirstDataBit) & 1) != 0;
  } else {
    far_level_ = tx_bit_ == kAfterData && settings_.parity != 'N' ? parity_bit(value) : true;
  }
  if (tx_bit_ == tx_flip_) far_level_ = !far_level_;
  ++tx_bit_;
  tx_due_ = far_bit_edge(tx_start_, tx_bit_);
}

void UartLine::card_pins(bool tx, bool de, Cycles now) {
  const bool was = card_level_;
  if (card_enabled_ && !de) traffic_until(now);
  card_enabled_ = de;
  card_level_ = de ? tx : true;
  if (was && !card_level_ && rx_bit_ < 0) {
    rx_start_ = now;
    rx_bit_ = 0;
    rx_value_ = 0;
    rx_bad_parity_ = false;
    rx_flip_ = bit_to_flip();
    rx_due_ = now + clock_.half_bits(1, settings_.baud);
  }
}

void UartLine::sample_rx_bit() {
  const int bit = rx_bit_;
  const bool level = card_level_ != (bit >= kFirstDataBit && bit == rx_flip_);
  const bool has_parity = settings_.parity != 'N';
  if (bit == 0 && level) {  // too short for a start bit
    rx_bit_ = -1;
    rx_due_ = kNever;
    return;
  }
  if (bit >= kFirstDataBit && bit < kAfterData) {
    rx_value_ = static_cast<std::uint8_t>(rx_value_ | level << (bit - kFirstDataBit));
  } else if (bit == kAfterData && has_parity) {
    rx_bad_parity_ = level != parity_bit(rx_value_);
  } else if (bit >= kAfterData) {  // first stop bit
    rx_bit_ = -1;
    rx_due_ = kNever;
    const Cycles end = bit_edge(rx_start_, settings_.char_bits());
    traffic_until(end);
    listener_(LineByte{Sender::kCard, rx_value_, rx_bad_parity_, !level, rx_start_, end});
    return;
  }
  ++rx_bit_;
  rx_due_ = rx_start_ + clock_.half_bits(2 * rx_bit_ + 1, settings_.baud);
}

}  // namespace card
