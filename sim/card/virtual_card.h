// SPDX-License-Identifier: Apache-2.0
// The Verilated card with its two lines. It steps the clock, moves bits between the pins and the lines, samples
// the LEDs, and can write a waveform. Other files handle wall time, file formats and command lines.

#pragma once

#include "far_end.h"
#include "frame.h"
#include "led_watch.h"

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
  UartLine& line(LineId which) { return port(which).line; }
  // Present colour of an LED.
  const char* led(LineId which) const;
  // Writes the waveform so far to its file, if there is one. Ends the program when the last call has written nothing.
  void flush_wave();

  // Ends open frames and the waveform. Nothing may run after it.
  void finish();

 private:
  // A line with its far end and its LED.
  struct Port {
    Port(LineId id, const SimClock& clock, const LineSettings& settings, FrameGrouper::Listener on_frame,
         LedWatch::Listener on_led);
    UartLine line;
    FrameGrouper frames;
    LedWatch led;
    FarEnd* far_end = nullptr;
  };

  Port& port(LineId which) { return which == LineId::kModbus ? modbus_ : drive_; }
  // Of an LED: bit 0 red, bit 1 green.
  unsigned colour(LineId which) const;
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
  Cycles now_ = 0;
  Cycles next_event_ = 0;
  unsigned last_pins_ = 0;
  bool finished_ = false;
  std::string wave_file_;
  std::int64_t wave_bytes_ = -1;  // size of the file at the last flush
};

}  // namespace card
