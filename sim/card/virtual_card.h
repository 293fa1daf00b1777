// SPDX-License-Identifier: Apache-2.0
// The Verilated card with its two lines: steps the clock, moves bits between the pins and the lines, samples
// the LEDs, and can write a waveform. Knows nothing of wall time, files' formats or command lines.

#ifndef VIRTUAL_CARD_H
#define VIRTUAL_CARD_H

#include <memory>
#include <string>

#include "far_end.h"
#include "frame.h"
#include "led_watch.h"
#include "sim_clock.h"
#include "uart_line.h"

namespace harness {
class CardModel;
}

namespace card {

struct CardSetup {
  SimClock clock;
  unsigned sw_baud = 0;
  unsigned sw_addr = 0;
  std::string firmware_folder;  // where FIRMWARE_HEX of the build lies
  std::string wave_file;        // empty: none
};

class VirtualCard {
 public:
  VirtualCard(const CardSetup& setup, FrameGrouper::Listener on_frame, LedWatch::Listener on_led);
  ~VirtualCard();
  VirtualCard(const VirtualCard&) = delete;
  VirtualCard& operator=(const VirtualCard&) = delete;

  void connect(FarEnd& master, FarEnd& drive);
  // Time since the release of the reset.
  Cycles now() const { return now_; }
  void run(Cycles cycles);
  // Everything that began before this has been handed to the listeners.
  Cycles settled() const;
  // Power off and on: everything on the lines is lost, the switches are read anew. Time goes on.
  void power_cycle(unsigned sw_baud, unsigned sw_addr);
  UartLine& line(LineId which) { return which == LineId::kModbus ? modbus_.line : drive_.line; }
  // What an LED shows at this moment.
  const char* led(LineId which) const;
  // Ends frames still open and the waveform; nothing may run afterwards.
  void finish();

 private:
  struct Port {
    UartLine line;
    FrameGrouper frames;
    FarEnd* far_end;
  };

  void load_firmware(const std::string& folder);
  void reset();
  template <bool kWave>
  void clock_until(Cycles end);
  void step_far_ends();
  void serve_lines();
  void pins_changed(unsigned pins);
  void drive_inputs();
  void open_wave(const std::string& path);
  void clock_into_wave();

  const SimClock clock_;
  const Cycles slice_;
  std::unique_ptr<harness::CardModel> model_;
  Port modbus_;
  Port drive_;
  LedWatch modbus_led_;
  LedWatch drive_led_;
  Cycles now_ = 0;
  Cycles next_event_ = 0;
  unsigned last_pins_ = 0;
  bool finished_ = false;
};

}  // namespace card

#endif
