// SPDX-License-Identifier: Apache-2.0
// The virtual card: joins lines, far ends, logs and pace to VirtualCard.
// Exit codes: 0 ended by --for or a signal, 2 wrong option, busy path or full disk.

#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "control.h"
#include "options.h"
#include "pacer.h"
#include "recording.h"
#include "user_error.h"
#include "version.h"
#include "virtual_card.h"

namespace {

using namespace card;

constexpr SimClock kClock{CARD_CLK_HZ};
constexpr int kDriveResponseUs = 5'000;       // of the simulated drive; real drives take 2.3 ms to 50 ms
constexpr double kForeignDriveSeconds = 0.3;  // longer than any legal drive needs
constexpr double kStartSeconds = 0.3;         // run before 'ready': boot, of SERV too, and speed measurement
constexpr int kStepUs = 500;                  // between two readings of the wall clock
constexpr double kWarnBelow = 0.98;           // x real time
constexpr int kWarnEvery = 10;                // simulated seconds
constexpr int kOversampling = 64;             // clocks a bit (LINE-5)
constexpr unsigned kEndSeconds = 5;           // from a signal to the end of the files

volatile sig_atomic_t stop_requested = 0;

// An output that nobody reads holds up the last lines, and must not hold up the end.
void request_stop(int) {
  stop_requested = 1;
  alarm(kEndSeconds);
}

void catch_signals() {
  struct sigaction action{};
  action.sa_handler = request_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGHUP, &action, nullptr);  // sent when the terminal is closed
  sigaction(SIGTERM, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
}

void print_frame(const Frame& frame) {
  std::printf("%11s  %-6s %-6s  %s\n%30s%s%s\n", kClock.text(frame.start).c_str(), line_name(frame.line),
              sender_name(frame), hex_text(frame.bytes).c_str(), "", frame.ok() ? "" : "BAD: ",
              frame.what.c_str());
  std::fflush(stdout);
}

void print_led(const LedChange& change) {
  std::printf("%11s  %-6s LED     %s\n", kClock.text(change.at).c_str(), change.led.c_str(),
              change.shows.c_str());
  std::fflush(stdout);
}

std::unique_ptr<BytePort> open_port(const std::string& device, const std::string& link, const LineSettings& line) {
  return device.empty() ? open_pty(link) : open_serial_port(device, line);
}

std::unique_ptr<FarEnd> open_master(const Options& options) {
  const LineSettings line = network_settings(options.sw_baud, kClock);
  return std::make_unique<PortFarEnd>(open_port(options.modbus_device, options.modbus_link, line), line, kClock, 0);
}

std::unique_ptr<FarEnd> open_drive(const Options& options) {
  const LineSettings line = drive_settings(kClock);
  if (options.drive_device.empty() && options.drive_link.empty())
    return std::make_unique<DriveEnd>(*options.profile, options.example, line, kClock,
                                      kClock.from_microseconds(kDriveResponseUs));
  return std::make_unique<PortFarEnd>(open_port(options.drive_device, options.drive_link, line), line, kClock,
                                      kClock.from_seconds(kForeignDriveSeconds));
}

// Folder of this program, which holds the firmware images.
std::string own_folder() {
  char path[4096];
  const ssize_t length = readlink("/proc/self/exe", path, sizeof path);
  if (length <= 0 || length == static_cast<ssize_t>(sizeof path))
    throw system_error("cannot find this program's folder");
  const std::string name(path, static_cast<std::size_t>(length));
  return name.substr(0, name.rfind('/'));
}

void warn_about_switches(const Options& options) {
  const LineSettings line = network_settings(options.sw_baud, kClock);
  if (static_cast<std::int64_t>(line.baud) * kOversampling > kClock.hz)
    std::fprintf(stderr, "card: warning: %d bit/s need a clock of %.1f MHz, this card runs at %.1f MHz\n",
                 line.baud, line.baud * kOversampling / 1e6, static_cast<double>(kClock.hz) / 1e6);
  if (options.sw_addr == 0 || options.sw_addr > 247)
    std::fprintf(stderr, "card: warning: address switches give %u, not 1 to 247: the card stays silent\n",
                 options.sw_addr);
}

void check_files(const Recording& recording) {
  if (!recording.trouble().empty()) throw UserError(recording.trouble());
}

void run(const Options& options) {
  const LineSettings network = network_settings(options.sw_baud, kClock);
  Recording recording(kClock, Describer(*options.dialect, *options.profile), options.log_file,
                      options.pcap_file);
  if (!options.quiet) recording.listen(print_frame, print_led);
  recording.network_line(network.name());
  const std::unique_ptr<FarEnd> master = open_master(options);
  const std::unique_ptr<FarEnd> drive = open_drive(options);
  const std::string firmware = own_folder() + options.dialect->images[options.image];
  CardSetup setup{kClock, options.sw_baud, options.sw_addr, firmware, options.wave_file};
  VirtualCard virtual_card(
      setup, [&](const Frame& frame) { recording.frame(frame); },
      [&](const LedChange& change) { recording.led(change); });
  virtual_card.connect(*master, *drive);
  warn_about_switches(options);

  const Cycles end = options.seconds > 0 ? kClock.from_seconds(options.seconds) : kNever;
  const Cycles step = kClock.from_microseconds(kStepUs);
  const Cycles start = std::min(end, kClock.from_seconds(kStartSeconds));
  Pacer pacer(kClock);
  virtual_card.run(start);
  pacer.run_free(start);
  if (!options.quiet)
    std::printf("card at %.1f MHz, dialect %s, unit %u, %s; one core can do %.1f x real time\n",
                static_cast<double>(kClock.hz) / 1e6, options.dialect->name, options.sw_addr,
                network.name().c_str(), pacer.possible_ratio());
  std::printf("ready modbus=%s drive=%s\n", master->name().c_str(), drive->name().c_str());
  std::fflush(stdout);

  Control control(kClock, {options.sw_baud, options.sw_addr}, virtual_card,
                  dynamic_cast<DriveEnd*>(drive.get()), !options.modbus_device.empty());
  CommandInput commands(STDIN_FILENO);
  std::vector<int> wake_up = {master->fd(), drive->fd()};
  if (options.control) wake_up.push_back(commands.fd());
  Cycles next_check = virtual_card.now() + kClock.hz;
  Cycles next_warning = 0;
  while (stop_requested == 0 && virtual_card.now() < end) {
    const Cycles cycles = std::min(step, end - virtual_card.now());
    virtual_card.run(cycles);
    recording.write_until(virtual_card.settled());
    check_files(recording);
    if (options.control) {
      for (const std::string& command : commands.take()) std::puts(control.run(command).c_str());
      recording.network_line(network_settings(control.read().baud, kClock).name());
      std::fflush(stdout);
      if (commands.ended()) break;
    }
    if (options.real_time || drive->answer_expected(virtual_card.now())) {
      pacer.keep_to_wall_time(cycles, wake_up);
    } else {
      pacer.run_free(cycles);
    }
    if (virtual_card.now() < next_check) continue;
    next_check = virtual_card.now() + kClock.hz;
    virtual_card.flush_wave();
    const double ratio = pacer.take_shortfall();
    if (options.real_time && ratio < kWarnBelow && virtual_card.now() >= next_warning) {
      std::fprintf(stderr, "card: warning: too slow, running at %.2f x real time\n", ratio);
      next_warning = virtual_card.now() + kWarnEvery * kClock.hz;
    }
  }
  virtual_card.finish();
  recording.close();
  check_files(recording);
  if (!options.quiet)
    std::printf("simulated %.1f s in %.1f s; one core can do %.1f x real time\n", pacer.simulated_seconds(),
                pacer.wall_seconds(), pacer.possible_ratio());
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Options options = parse_options(argc, argv);
    if (options.help) {
      std::fputs(help_text().c_str(), stdout);
    } else if (options.version) {
      std::printf("rtu2fc " CARD_VERSION ", virtual card of %lld Hz\n", static_cast<long long>(kClock.hz));
    } else {
      catch_signals();
      run(options);
    }
    return 0;
  } catch (const UserError& error) {
    std::fprintf(stderr, "card: %s\n", error.what());
    return 2;
  }
}
