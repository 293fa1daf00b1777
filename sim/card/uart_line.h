// SPDX-License-Identifier: Apache-2.0
// The two serial lines: rate, format and silences as the card's switches set them (LINE-1..3, FRAME-1, FC-8), and
// one half-duplex RS-485 pair in simulated time. It sends the bytes of the far end to the card's receive pin, bit
// by bit, and reads the bytes that the card sends. All times in cycles of the card's clock.

#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "sim_clock.h"

namespace card {

using Bytes = std::vector<std::uint8_t>;

// Silences of a line. A silence longer than `inside` may not occur in a frame; one longer than `between` ends
// the frame. On the drive line both are equal.
struct Silences {
  Cycles inside;
  Cycles between;
  Cycles character;  // unit in which silences are reported; above 19200 bit/s longer than 11 bits (FRAME-1)
};

struct LineSettings {
  int baud;           // bit/s
  char parity;        // 'N', 'O' or 'E'
  int stop_bits;      // sent; a receiver needs only the first
  Silences silences;  // a byte that starts within `inside` of the previous one belongs to its frame
  Cycles burst_gap;   // silence before a new burst

  int char_bits() const { return 1 + 8 + (parity == 'N' ? 0 : 1) + stop_bits; }
  std::string name() const;  // "9600 8N2"
};

// Switch values as the pins take them: bit n-1 = switch n, 1 = ON.
LineSettings network_settings(unsigned sw_baud, const SimClock& clock);
LineSettings drive_settings(const SimClock& clock);

enum class Sender { kFarEnd, kCard };

struct LineByte {
  Sender sender;
  std::uint8_t value;
  bool bad_parity;
  bool bad_stop;
  Cycles start;  // first edge of the start bit
  Cycles end;    // end of the last stop bit

  bool bad() const { return bad_parity || bad_stop; }
};

class UartLine {
 public:
  using Listener = std::function<void(const LineByte&)>;

  UartLine(const SimClock& clock, const LineSettings& settings, Listener listener);

  // Queues bytes of the far end; they follow one another without gaps.
  void send(const Bytes& bytes, Cycles now);
  bool far_end_sending() const { return tx_bit_ >= 0; }

  // Cycle of the next event; call run() with it before that cycle is simulated.
  Cycles next_event() const { return tx_due_ < rx_due_ ? tx_due_ : rx_due_; }
  void run(Cycles now);

  // Faults of the wire, until changed again. Noise and a cut wire affect both directions. The listener gets
  // the bytes as the receiver reads them, and none from a far end that is cut off.
  struct Trouble {
    bool cut = false;
    int noise = 0;          // bytes in a thousand with one bit inverted
    double baud_error = 0;  // percent by which the far end sends too fast
  };
  const Trouble& trouble() const { return trouble_; }
  void set_trouble(const Trouble& trouble) { trouble_ = trouble; }
  // Another rate and format; the line must be idle.
  void use(const LineSettings& settings) { settings_ = settings; }

  // The card's transmit and driver-enable pins changed at `now`.
  void card_pins(bool tx, bool de, Cycles now);
  // Level of the pair at the card's receive pin: idle 1; a 0 from either end wins.
  bool level() const { return (trouble_.cut || far_level_) && card_level_; }

  // Start of the oldest byte still on the line, kNever if there is none.
  Cycles byte_since() const {
    return std::min(far_end_sending() ? tx_start_ : kNever, rx_bit_ >= 0 ? rx_start_ : kNever);
  }
  bool busy() const { return far_end_sending() || rx_bit_ >= 0 || card_enabled_; }
  // End of the last traffic; meaningful while not busy().
  Cycles silent_since() const { return silent_since_; }

 private:
  void next_tx_bit(Cycles now);
  void sample_rx_bit();
  Cycles bit_edge(Cycles start, int bit) const { return start + clock_.half_bits(2 * bit, settings_.baud); }
  Cycles far_bit_edge(Cycles start, int bit) const;
  int bit_to_flip();
  bool parity_bit(std::uint8_t value) const;
  void traffic_until(Cycles end) { silent_since_ = end > silent_since_ ? end : silent_since_; }

  const SimClock clock_;
  LineSettings settings_;
  Listener listener_;
  Trouble trouble_;
  std::minstd_rand noise_{1};  // fixed seed: every run has the same noise
  Cycles silent_since_ = 0;

  // far end -> card: tx_bit_ is the bit on the line, 0 = start bit, -1 = idle
  std::deque<std::uint8_t> tx_queue_;
  int tx_bit_ = -1;
  Cycles tx_start_ = 0;
  Cycles tx_due_ = kNever;
  int tx_flip_ = -1;  // bit that noise inverts, -1: none
  bool far_level_ = true;

  // card -> far end: rx_bit_ is the bit to sample next, -1 = waiting for a start edge
  int rx_bit_ = -1;
  Cycles rx_start_ = 0;
  Cycles rx_due_ = kNever;
  std::uint8_t rx_value_ = 0;
  int rx_flip_ = -1;
  bool rx_bad_parity_ = false;
  bool card_level_ = true;
  bool card_enabled_ = false;
};

}  // namespace card
