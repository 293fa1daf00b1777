// SPDX-License-Identifier: Apache-2.0
// The Verilated card with its two lines. It steps the clock, moves bits between the pins and the lines, samples
// the LEDs, and can write a waveform. Other files handle wall time, file formats and command lines.

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
  std::string firmware_folder;  // the folder with the file FIRMWARE_HEX
  std::string wave_file;        // empty: no waveform
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
  // The listeners have been called for all frames and LED changes that began before this time.
  Cycles settled() const;
  // Power off and on: frames on the lines are lost, and the card reads the switches again. Time continues.
  void power_cycle(unsigned sw_baud, unsigned sw_addr);
  UartLine& line(LineId which) { return which == LineId::kModbus ? modbus_.line : drive_.line; }
  // Present colour of an LED.
  const char* led(LineId which) const;
  // Writes the waveform so far to its file, if there is one. Ends the program when the last call has written nothing.
  void flush_wave();

  // Ends open frames and the waveform. Nothing may run after it.
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
  std::string wave_file_;
  std::int64_t wave_bytes_ = -1;  // size of the file at the last flush
};

}  // namespace card

#endif
