// SPDX-License-Identifier: Apache-2.0
// Host side of a line of the virtual card: a pty or a real serial port. Never blocks.

#pragma once

#include <memory>

#include "uart_line.h"

namespace card {

class BytePort {
 public:
  virtual ~BytePort();
  BytePort(const BytePort&) = delete;
  BytePort& operator=(const BytePort&) = delete;

  // Reads until the descriptor is empty: one write() of the other program may arrive in pieces.
  virtual Bytes read_all();
  // Bytes that do not fit the buffer of an idle reader are lost, as on a wire.
  virtual void write(std::uint8_t byte);
  int fd() const { return fd_; }
  const std::string& name() const { return name_; }
  // Time for which the first batch of bytes is collected before it goes onto the line, in microseconds.
  int collect_us() const { return collect_us_; }

 protected:
  explicit BytePort(int collect_us) : collect_us_(collect_us) {}
  int fd_ = -1;
  std::string name_;

 private:
  const int collect_us_;
};

// A pseudo terminal in raw mode; `link`: a symbolic link to its other side, removed at the end, or empty. Throws
// UserError if `link` already exists.
std::unique_ptr<BytePort> open_pty(const std::string& link);
// A real serial port, raw, at the rate and format of the line; the PC takes the card's place. The end restores the
// previous settings. Throws UserError if `device` is no serial port, cannot be opened or is in use.
std::unique_ptr<BytePort> open_serial_port(const std::string& device, const LineSettings& line);

}  // namespace card
