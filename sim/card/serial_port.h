// SPDX-License-Identifier: Apache-2.0
// A real serial port, raw, at the rate and format of the line; the PC takes the card's place.

#ifndef SERIAL_PORT_H
#define SERIAL_PORT_H

#include <termios.h>

#include "byte_port.h"
#include "line_settings.h"

namespace card {

class SerialPort : public BytePort {
 public:
  // Throws UserError if `device` is no serial port, cannot be opened or is in use.
  SerialPort(const std::string& device, const LineSettings& line);
  // Restores the previous settings.
  ~SerialPort() override;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  std::vector<std::uint8_t> read_all() override { return read_until_empty(fd_); }
  void write(std::uint8_t byte) override { write_or_lose(fd_, byte); }
  int fd() const override { return fd_; }
  std::string name() const override { return device_; }
  // USB adapters deliver a frame in pieces up to 16 ms apart; on the simulated line it must have no gaps.
  int collect_us() const override { return 20'000; }

 private:
  std::string device_;
  int fd_ = -1;
  termios before_{};
};

}  // namespace card

#endif
