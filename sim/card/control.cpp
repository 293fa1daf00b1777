// SPDX-License-Identifier: Apache-2.0

#include "control.h"

#include <poll.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <utility>

#include "options.h"
#include "user_error.h"

namespace card {

namespace {

constexpr const char* kHelp =
    "trip [ALARM] | cut LINE on|off | noise LINE PER_THOUSAND | baud LINE PERCENT | "
    "switches RATE ADDRESS | power-cycle | state; LINE is modbus or drive";
constexpr int kOvercurrent = 13, kLastAlarm = 99;
constexpr int kThousand = 1000;
constexpr double kMostBaudError = 20;  // percent
constexpr std::size_t kLongestCommand = 512;

void expect(const std::vector<std::string>& words, std::size_t least, std::size_t most) {
  if (words.size() - 1 < least) throw UserError("'" + words[0] + "' needs more: " + kHelp);
  if (words.size() - 1 > most) throw UserError("'" + words[0] + "' takes no '" + words.back() + "'");
}

LineId line_id(const std::string& text) {
  if (text == "modbus") return LineId::kModbus;
  if (text == "drive") return LineId::kDrive;
  throw UserError("a line is modbus or drive, not '" + text + "'");
}

double number(const std::string& text, double least, double most) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(value >= least && value <= most)) {
    std::ostringstream range;
    range << "a number from " << least << " to " << most << " is wanted, not '" << text << "'";
    throw UserError(range.str());
  }
  return value;
}

std::string digits(unsigned value, std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += (value >> i & 1) != 0 ? '1' : '0';
  return text;
}

std::string both(const Control::Switches& at) {
  return "[\"" + digits(at.baud, kBaudSwitches) + "\",\"" + digits(at.addr, kAddrSwitches) + "\"]";
}

}  // namespace

Control::Control(const SimClock& clock, const Switches& switches, VirtualCard& virtual_card, DriveEnd* drive,
                 bool fixed_rate)
    : clock_(clock),
      card_(virtual_card),
      drive_(drive),
      fixed_rate_(fixed_rate),
      switches_(switches),
      read_(switches) {}

std::string Control::run(const std::string& command) {
  std::istringstream text(command);
  Words words;
  for (std::string word; text >> word;) words.push_back(word);
  try {
    if (words.empty()) throw UserError("no command; " + std::string(kHelp));
    const std::string& name = words[0];
    if (name == "state" || name == "help") {
      expect(words, 0, 0);
      return name == "help" ? kHelp : state();
    }
    if (name == "trip") {
      trip(words);
    } else if (name == "cut" || name == "noise" || name == "baud") {
      trouble(words);
    } else if (name == "switches") {
      set_switches(words);
    } else if (name == "power-cycle") {
      power_cycle(words);
    } else {
      throw UserError("unknown command '" + name + "'; " + kHelp);
    }
    return "ok";
  } catch (const UserError& error) {
    return std::string("error: ") + error.what();
  }
}

void Control::trip(const Words& words) {
  expect(words, 0, 1);
  const double alarm = words.size() > 1 ? number(words[1], 1, kLastAlarm) : kOvercurrent;
  if (drive_ == nullptr) throw UserError("only the simulated drive can be tripped");
  drive_->trip(static_cast<std::uint8_t>(alarm));
}

void Control::trouble(const Words& words) {
  expect(words, 2, 2);
  UartLine& line = card_.line(line_id(words[1]));
  UartLine::Trouble wanted = line.trouble();
  if (words[0] == "cut") {
    if (words[2] != "on" && words[2] != "off") throw UserError("cut is on or off, not '" + words[2] + "'");
    wanted.cut = words[2] == "on";
  } else if (words[0] == "noise") {
    wanted.noise = static_cast<int>(number(words[2], 0, kThousand));
  } else {
    wanted.baud_error = number(words[2], -kMostBaudError, kMostBaudError);
  }
  line.set_trouble(wanted);
}

void Control::set_switches(const Words& words) {
  expect(words, 2, 2);
  switches_ = {switches("switches", words[1], kBaudSwitches), switches("switches", words[2], kAddrSwitches)};
}

void Control::power_cycle(const Words& words) {
  expect(words, 0, 0);
  const auto name = [this](unsigned baud) { return network_settings(baud, clock_).name(); };
  if (fixed_rate_ && name(switches_.baud) != name(read_.baud))
    throw UserError("a real serial port keeps its rate and parity; start again with other switches");
  card_.power_cycle(switches_.baud, switches_.addr);
  if (drive_ != nullptr) drive_->power_cycle();
  read_ = switches_;
}

std::string Control::line_state(LineId which) const {
  const UartLine::Trouble& trouble = card_.line(which).trouble();
  std::ostringstream text;
  text << "{\"led\":\"" << card_.led(which) << "\",\"cut\":" << (trouble.cut ? "true" : "false")
       << ",\"noise\":" << trouble.noise << ",\"baud_error\":" << trouble.baud_error << "}";
  return text.str();
}

std::string Control::state() const {
  std::ostringstream text;
  text << "{\"state\":" << clock_.text(card_.now()) << ",\"modbus\":" << line_state(LineId::kModbus)
       << ",\"drive\":" << line_state(LineId::kDrive) << ",\"switches\":" << both(switches_)
       << ",\"read\":" << both(read_) << ",\"line\":\"" << network_settings(read_.baud, clock_).name()
       << "\",\"motor\":";
  if (drive_ == nullptr) {
    text << "null}";
    return text.str();
  }
  const drive_t* const drive = &drive_->drive();
  text << "{\"control\":" << drive_control_word(drive) << ",\"reference\":" << drive_reference_word(drive)
       << ",\"status\":" << drive_status_word(drive) << ",\"frequency\":" << drive_frequency_word(drive)
       << ",\"alarm\":" << static_cast<int>(drive_alarm(drive)) << "}}";
  return text.str();
}

CommandInput::CommandInput(int fd) : fd_(fd) {}

// One reading a call: whatever else is written waits in the pipe, and so does its writer.
std::vector<std::string> CommandInput::take() {
  pollfd descriptor{fd_, POLLIN, 0};
  if (ended_ || poll(&descriptor, 1, 0) <= 0) return {};
  char buffer[kLongestCommand];
  const ssize_t count = read(fd_, buffer, sizeof buffer);
  ended_ = count <= 0;
  if (!ended_) rest_.append(buffer, static_cast<std::size_t>(count));
  std::vector<std::string> lines;
  for (std::size_t end; (end = rest_.find('\n')) != std::string::npos; rest_.erase(0, end + 1))
    lines.push_back(rest_.substr(0, end));
  if (rest_.size() > kLongestCommand) lines.push_back(std::exchange(rest_, ""));
  return lines;
}

}  // namespace card
