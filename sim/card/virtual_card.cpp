// SPDX-License-Identifier: Apache-2.0

#include "virtual_card.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>
#include <verilated.h>
#include <verilated_fst_c.h>

#include <algorithm>
#include <iostream>
#include <utility>

#include "Vrtu2fc.h"
#include "line_settings.h"
#include "user_error.h"

namespace card {

namespace {

std::string wave_trouble;  // what is said then

constexpr int kSliceUs = 250;  // how often far ends, silences and LEDs are looked at
constexpr int kResetCycles = 16;
constexpr int kWaveDepth = 99;  // levels of hierarchy

// Outgoing line pins of the card, packed to see a change at one glance.
constexpr unsigned kModbusTx = 1, kModbusDe = 2, kDriveTx = 4, kDriveDe = 8;

}  // namespace

VirtualCard::VirtualCard(const CardSetup& setup, FrameGrouper::Listener on_frame, LedWatch::Listener on_led)
    : clock_(setup.clock),
      slice_(clock_.from_microseconds(kSliceUs)),
      context_(std::make_unique<VerilatedContext>()),
      modbus_{UartLine(clock_, network_settings(setup.sw_baud, clock_),
                       [this](const LineByte& byte) {
                         modbus_.frames.add(byte);
                         if (byte.sender == Sender::kCard && modbus_.far_end && !modbus_.line.trouble().cut)
                           modbus_.far_end->from_card(byte);
                       }),
              FrameGrouper(LineId::kModbus, network_settings(setup.sw_baud, clock_).silences, on_frame),
              nullptr},
      drive_{UartLine(clock_, drive_settings(clock_),
                      [this](const LineByte& byte) {
                        drive_.frames.add(byte);
                        if (byte.sender == Sender::kCard && drive_.far_end && !drive_.line.trouble().cut)
                          drive_.far_end->from_card(byte);
                      }),
             FrameGrouper(LineId::kDrive, drive_settings(clock_).silences, on_frame), nullptr},
      modbus_led_("modbus", clock_, on_led),
      drive_led_("drive", clock_, on_led) {
  context_->randReset(0);
  context_->traceEverOn(!setup.wave_file.empty());
  top_ = std::make_unique<Vrtu2fc>(context_.get());
  if (!setup.wave_file.empty()) open_wave(setup.wave_file);
  top_->sw_baud = static_cast<SData>(setup.sw_baud);
  top_->sw_addr = static_cast<CData>(setup.sw_addr);
  load_firmware(setup.firmware_folder);
  reset();
}

VirtualCard::~VirtualCard() { finish(); }

void VirtualCard::connect(FarEnd& master, FarEnd& drive) {
  modbus_.far_end = &master;
  drive_.far_end = &drive;
}

// The writer of waveforms ends the program with abort() and words of its own when the disk is full.
void VirtualCard::open_wave(const std::string& path) {
  // The waveform writer does not tell when it cannot create its file.
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) throw system_error("cannot write " + path);
  close(file);
  wave_trouble = "card: cannot write " + path + ": the disk is full\n";
  signal(SIGABRT, [](int) {
    const ssize_t told = write(STDERR_FILENO, wave_trouble.data(), wave_trouble.size());
    _exit(told < 0 ? 3 : 2);
  });
  std::cerr.rdbuf(nullptr);
  wave_ = std::make_unique<VerilatedFstC>();
  top_->trace(wave_.get(), kWaveDepth);
  wave_->open(path.c_str());
}

void VirtualCard::dump_wave(bool second_half) {
  const auto whole = static_cast<std::uint64_t>(clock_.nanoseconds(now_));
  const auto half = static_cast<std::uint64_t>(second_half ? clock_.nanoseconds(1) / 2 : 0);
  wave_->dump(whole + half);
}

// The model reads FIRMWARE_HEX, a name without a path, from the working directory in its first evaluation.
void VirtualCard::load_firmware(const std::string& folder) {
  const std::string image = folder + "/" + CARD_FIRMWARE_HEX;
  if (access(image.c_str(), R_OK) != 0)
    throw UserError("no firmware: " + image + " is missing (make card makes it)");
  const int here = open(".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (here < 0 || chdir(folder.c_str()) != 0) throw system_error("cannot enter " + folder);
  drive_inputs();
  top_->eval();
  const bool back = fchdir(here) == 0;
  close(here);
  if (!back) throw system_error("cannot go back to the working directory");
}

// Both lines idle high from the first moment: a simulator's inputs start at 0, which would be a break. The
// waveform begins at the release, so that its times are those of the log.
void VirtualCard::reset() {
  top_->rst_n = 0;
  now_ = -kResetCycles;
  next_event_ = kNever;
  clock_until<false>(0);
  top_->rst_n = 1;
  next_event_ = 0;
}

// The firmware image stays: it begins anew at each reset.
void VirtualCard::power_cycle(unsigned sw_baud, unsigned sw_addr) {
  top_->rst_n = 0;
  top_->sw_baud = static_cast<SData>(sw_baud);
  top_->sw_addr = static_cast<CData>(sw_addr);
  run(kResetCycles);
  modbus_.frames.flush();
  drive_.frames.flush();
  const LineSettings settings = network_settings(sw_baud, clock_);
  modbus_.line.use(settings);
  modbus_.frames.use(settings.silences);
  modbus_.far_end->use(settings);
  top_->rst_n = 1;
}

const char* VirtualCard::led(LineId which) const {
  const bool modbus = which == LineId::kModbus;
  const unsigned red = modbus ? top_->led_modbus_red : top_->led_drive_red;
  const unsigned green = modbus ? top_->led_modbus_green : top_->led_drive_green;
  static constexpr const char* kShows[] = {"off", "red", "green", "orange"};
  return kShows[red | green << 1];
}

unsigned VirtualCard::pins() const {
  return (top_->modbus_tx ? kModbusTx : 0u) | (top_->modbus_de ? kModbusDe : 0u) |
         (top_->drive_tx ? kDriveTx : 0u) | (top_->drive_de ? kDriveDe : 0u);
}

void VirtualCard::drive_inputs() {
  top_->modbus_rx = modbus_.line.level();
  top_->drive_rx = drive_.line.level();
}

void VirtualCard::pins_changed(unsigned pins) {
  const unsigned changed = pins ^ last_pins_;
  last_pins_ = pins;
  if (changed & (kModbusTx | kModbusDe))
    modbus_.line.card_pins((pins & kModbusTx) != 0, (pins & kModbusDe) != 0, now_);
  if (changed & (kDriveTx | kDriveDe))
    drive_.line.card_pins((pins & kDriveTx) != 0, (pins & kDriveDe) != 0, now_);
  drive_inputs();
  next_event_ = std::min(modbus_.line.next_event(), drive_.line.next_event());
}

void VirtualCard::serve_lines() {
  while (next_event_ <= now_) {
    modbus_.line.run(now_);
    drive_.line.run(now_);
    next_event_ = std::min(modbus_.line.next_event(), drive_.line.next_event());
  }
  drive_inputs();
}

template <bool kWave>
void VirtualCard::clock_until(Cycles end) {
  while (now_ < end) {
    if (now_ >= next_event_) serve_lines();
    top_->clk = 1;
    top_->eval();
    if (kWave) dump_wave(false);
    top_->clk = 0;
    top_->eval();
    if (kWave) dump_wave(true);
    ++now_;
    const unsigned levels = pins();
    if (levels != last_pins_) pins_changed(levels);
  }
}

void VirtualCard::step_far_ends() {
  for (Port* port : {&modbus_, &drive_}) {
    if (!port->line.busy()) port->frames.tick(now_);
    port->far_end->step(port->line, now_);
  }
  next_event_ = std::min(modbus_.line.next_event(), drive_.line.next_event());
  modbus_led_.sample(top_->led_modbus_red, top_->led_modbus_green, now_);
  drive_led_.sample(top_->led_drive_red, top_->led_drive_green, now_);
}

void VirtualCard::run(Cycles cycles) {
  const Cycles end = now_ + cycles;
  while (now_ < end) {
    step_far_ends();
    const Cycles slice_end = std::min(end, now_ + slice_);
    if (wave_) {
      clock_until<true>(slice_end);
    } else {
      clock_until<false>(slice_end);
    }
  }
}

Cycles VirtualCard::settled() const {
  Cycles since = now_;
  for (const Port* port : {&modbus_, &drive_})
    since = std::min({since, port->frames.open_since(), port->line.byte_since()});
  return std::min({since, modbus_led_.undecided_since(), drive_led_.undecided_since()});
}

void VirtualCard::finish() {
  if (finished_) return;
  finished_ = true;
  modbus_.frames.flush();
  drive_.frames.flush();
  if (wave_) wave_->close();
  wave_.reset();
  top_->final();
}

}  // namespace card
