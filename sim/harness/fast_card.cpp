// SPDX-License-Identifier: Apache-2.0
// The Verilated bench wrapper wired_card as a library for tests that wait for seconds.
//
// Nothing but the model runs here, so a clock costs a tenth of what it does under cocotb. Inputs change when
// they were planned to, every change of an output is kept. Unit of time: clocks. See tb/lib/fast_card.py.
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "Vwired_card.h"
#include "verilated.h"

namespace {

// Both in the order of INPUTS and OUTPUTS in tb/lib/fast_card.py.
enum Input {
  kResetN,
  kSwBaud,
  kSwAddr,
  kWired,
  kModbusLine,
  kDriveLine,
  kCutToModbus,
  kCutToDrive,
  kFlipToModbus,
  kFlipToDrive,
};

constexpr unsigned kOutputs = 17;

struct Change {
  uint64_t clock;
  uint32_t pin;
  uint32_t value;
};

}  // namespace

struct FastCard {
  VerilatedContext context;
  std::unique_ptr<Vwired_card> top;
  uint64_t clock = 0;
  std::multimap<uint64_t, Change> planned;
  std::vector<Change> seen;
  uint32_t outputs = 0;

  FastCard() : top(new Vwired_card(&context)) {
    top->clk = 0;
    top->modbus_line = 1;
    top->drive_line = 1;
    top->eval();
  }

  uint32_t read() const {
    return static_cast<uint32_t>(top->modbus_tx | top->modbus_de << 1 | top->drive_tx << 2 |
                                 top->drive_de << 3 | top->led_modbus_red << 4 | top->led_modbus_green << 5 |
                                 top->led_drive_red << 6 | top->led_drive_green << 7 | top->modbus_rx << 8 |
                                 top->drive_rx << 9 | top->candidate << 10 | top->commit << 11 |
                                 top->revoke << 12 | top->reply_queued << 13 | top->telegram_queued << 14 |
                                 top->drive_candidate << 15 | top->drive_good << 16);
  }

  void set(uint32_t pin, uint32_t value) {
    switch (pin) {
      case kResetN: top->rst_n = value & 1; break;
      case kSwBaud: top->sw_baud = value & 0x1FF; break;
      case kSwAddr: top->sw_addr = value & 0xFF; break;
      case kWired: top->wired = value & 1; break;
      case kModbusLine: top->modbus_line = value & 1; break;
      case kDriveLine: top->drive_line = value & 1; break;
      case kCutToModbus: top->cut_to_modbus = value & 1; break;
      case kCutToDrive: top->cut_to_drive = value & 1; break;
      case kFlipToModbus: top->flip_to_modbus = value & 1; break;
      case kFlipToDrive: top->flip_to_drive = value & 1; break;
    }
  }

  // One clock; true if an output of `stop` changed.
  bool step(uint32_t stop) {
    while (!planned.empty() && planned.begin()->first <= clock) {
      set(planned.begin()->second.pin, planned.begin()->second.value);
      planned.erase(planned.begin());
    }
    top->clk = 1;
    top->eval();
    top->clk = 0;
    top->eval();
    const uint32_t now = read();
    const uint32_t changed = now ^ outputs;
    for (uint32_t pin = 0; changed != 0 && pin < kOutputs; pin++)
      if (changed >> pin & 1) seen.push_back({clock, pin, now >> pin & 1});
    outputs = now;
    clock++;
    return (changed & stop) != 0;
  }
};

extern "C" {

FastCard* fast_card_new() { return new FastCard; }

void fast_card_free(FastCard* card) {
  card->top->final();
  delete card;
}

// The input takes this value at that clock, at once if it is past.
void fast_card_plan(FastCard* card, uint64_t clock, uint32_t pin, uint32_t value) {
  card->planned.emplace(clock, Change{clock, pin, value});
}

// Runs until `until`, or until one of the outputs in the mask `stop` has changed; returns the time.
uint64_t fast_card_run(FastCard* card, uint64_t until, uint32_t stop) {
  while (card->clock < until && !card->step(stop)) {
  }
  return card->clock;
}

// Takes the changes seen so far, `room` at most; returns how many.
size_t fast_card_changes(FastCard* card, Change* to, size_t room) {
  const size_t count = card->seen.size() < room ? card->seen.size() : room;
  for (size_t i = 0; i < count; i++) to[i] = card->seen[i];
  card->seen.erase(card->seen.begin(), card->seen.begin() + static_cast<ptrdiff_t>(count));
  return count;
}
}
