// SPDX-License-Identifier: Apache-2.0

#include "virtual_card.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <utility>

#include "card_model.h"
#include "user_error.h"

namespace card {

namespace {

std::string wave_trouble;  // message for a full disk

constexpr int kSliceUs = 250;  // period for far ends, silences and LEDs
constexpr int kResetCycles = 16;

constexpr unsigned level(unsigned pins, harness::Signal signal) { return pins >> signal & 1u; }

}  // namespace

VirtualCard::Port::Port(LineId id, const SimClock& clock, const LineSettings& settings,
                        FrameGrouper::Listener on_frame, LedWatch::Listener on_led)
    : line(clock, settings,
           [this](const LineByte& byte) {
             frames.add(byte);
             if (byte.sender == Sender::kCard && far_end != nullptr && !line.trouble().cut) far_end->from_card(byte);
           }),
      frames(id, settings.silences, std::move(on_frame)),
      led(line_name(id), clock, std::move(on_led)) {}

VirtualCard::VirtualCard(const CardSetup& setup, FrameGrouper::Listener on_frame, LedWatch::Listener on_led)
    : clock_(setup.clock),
      slice_(clock_.from_microseconds(kSliceUs)),
      modbus_(LineId::kModbus, clock_, network_settings(setup.sw_baud, clock_), on_frame, on_led),
      drive_(LineId::kDrive, clock_, drive_settings(clock_), on_frame, on_led) {
  model_ = std::make_unique<harness::CardModel>(harness::PowerUp{setup.sw_baud, setup.sw_addr});
  if (!setup.wave_file.empty()) open_wave(setup.wave_file);
  load_firmware(setup.firmware_folder);
  reset();
}

VirtualCard::~VirtualCard() { finish(); }

void VirtualCard::connect(FarEnd& master, FarEnd& drive) {
  modbus_.far_end = &master;
  drive_.far_end = &drive;
}

// When the disk is full, the waveform writer or flush_wave() calls abort(), the writer with a message. The handler prints one
// line instead and ends the program with exit code 2.
void VirtualCard::open_wave(const std::string& path) {
  // The waveform writer does not report a file that it cannot create.
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) throw system_error("cannot write " + path);
  close(file);
  wave_file_ = path;
  wave_trouble = "card: cannot write " + path + ": the disk is full\n";
  signal(SIGABRT, [](int) {
    const ssize_t written = write(STDERR_FILENO, wave_trouble.data(), wave_trouble.size());
    _exit(written < 0 ? 3 : 2);
  });
  std::cerr.rdbuf(nullptr);
  model_->open_wave(path.c_str());
}

// The writer ignores a write that fails, until the waveform ends. Then its file no longer grows.
void VirtualCard::flush_wave() {
  if (!model_->has_wave()) return;
  struct stat file {};
  if (stat(wave_file_.c_str(), &file) == 0 && S_ISREG(file.st_mode)) {
    if (file.st_size <= wave_bytes_) std::abort();
    wave_bytes_ = file.st_size;
  }
  model_->flush_wave();
}

void VirtualCard::clock_into_wave() {
  const auto rise = static_cast<std::uint64_t>(clock_.nanoseconds(now_));
  const auto half = static_cast<std::uint64_t>(clock_.nanoseconds(1) / 2);
  model_->clock_into_wave(rise, rise + half);
}

// The model reads FIRMWARE_HEX, a name without a path, from the working directory when it is switched on.
void VirtualCard::load_firmware(const std::string& folder) {
  const std::string image = folder + "/" + CARD_FIRMWARE_HEX;
  if (access(image.c_str(), R_OK) != 0)
    throw UserError("no firmware: " + image + " is missing (make card makes it)");
  const int here = open(".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (here < 0 || chdir(folder.c_str()) != 0) throw system_error("cannot enter " + folder);
  drive_inputs();
  model_->power_on();
  const bool back = fchdir(here) == 0;
  close(here);
  if (!back) throw system_error("cannot go back to the working directory");
}

// Both lines are high before the first clock: a simulator's inputs start at 0, which would be a break. The
// waveform begins at the release of the reset, so its times equal those of the log.
void VirtualCard::reset() {
  model_->reset(true);
  now_ = -kResetCycles;
  next_event_ = kNever;
  clock_until<false>(0);
  model_->reset(false);
  next_event_ = 0;
}

// The memory keeps the firmware image. The firmware starts again after each reset.
void VirtualCard::power_cycle(unsigned sw_baud, unsigned sw_addr) {
  model_->reset(true);
  model_->pins().sw_baud = static_cast<SData>(sw_baud);
  model_->pins().sw_addr = static_cast<CData>(sw_addr);
  run(kResetCycles);
  modbus_.frames.flush();
  drive_.frames.flush();
  const LineSettings settings = network_settings(sw_baud, clock_);
  modbus_.line.use(settings);
  modbus_.frames.use(settings.silences);
  modbus_.far_end->use(settings);
  model_->reset(false);
}

unsigned VirtualCard::colour(LineId which) const {
  return model_->leds() >> (which == LineId::kModbus ? harness::kModbusRedLed : harness::kDriveRedLed) & 3u;
}

const char* VirtualCard::led(LineId which) const {
  static constexpr const char* kShows[] = {"off", "red", "green", "orange"};
  return kShows[colour(which)];
}

void VirtualCard::drive_inputs() {
  model_->pins().modbus_rx = modbus_.line.level();
  model_->pins().drive_rx = drive_.line.level();
}

void VirtualCard::pins_changed(unsigned pins) {
  const unsigned changed = pins ^ last_pins_;
  last_pins_ = pins;
  if (level(changed, harness::kModbusTx) || level(changed, harness::kModbusDe))
    modbus_.line.card_pins(level(pins, harness::kModbusTx), level(pins, harness::kModbusDe), now_);
  if (level(changed, harness::kDriveTx) || level(changed, harness::kDriveDe))
    drive_.line.card_pins(level(pins, harness::kDriveTx), level(pins, harness::kDriveDe), now_);
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
    if (kWave) {
      clock_into_wave();
    } else {
      model_->clock();
    }
    ++now_;
    const unsigned levels = model_->line_pins();
    if (levels != last_pins_) pins_changed(levels);
  }
}

void VirtualCard::step_far_ends() {
  for (Port* port : {&modbus_, &drive_}) {
    if (!port->line.busy()) port->frames.tick(now_);
    port->far_end->step(port->line, now_);
  }
  next_event_ = std::min(modbus_.line.next_event(), drive_.line.next_event());
  for (const LineId which : {LineId::kModbus, LineId::kDrive}) port(which).led.sample(colour(which), now_);
}

void VirtualCard::run(Cycles cycles) {
  const Cycles end = now_ + cycles;
  while (now_ < end) {
    step_far_ends();
    const Cycles slice_end = std::min(end, now_ + slice_);
    if (model_->has_wave()) {
      clock_until<true>(slice_end);
    } else {
      clock_until<false>(slice_end);
    }
  }
}

Cycles VirtualCard::settled() const {
  Cycles since = now_;
  for (const Port* port : {&modbus_, &drive_})
    since = std::min({since, port->frames.open_since(), port->line.byte_since(), port->led.undecided_since()});
  return since;
}

void VirtualCard::finish() {
  if (finished_) return;
  finished_ = true;
  modbus_.frames.flush();
  drive_.frames.flush();
  model_->finish();
}

}  // namespace card
