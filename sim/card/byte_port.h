// SPDX-License-Identifier: Apache-2.0
// Host side of a line of the virtual card: a pty or a real serial port. Never blocks.

#ifndef BYTE_PORT_H
#define BYTE_PORT_H

#include <cstdint>
#include <string>
#include <vector>

namespace card {

class BytePort {
 public:
  virtual ~BytePort() = default;
  // Reads until the descriptor is empty: one write() of the other program may arrive in pieces.
  virtual std::vector<std::uint8_t> read_all() = 0;
  // Bytes that do not fit the buffer of an idle reader are lost, as on a wire.
  virtual void write(std::uint8_t byte) = 0;
  virtual int fd() const = 0;
  virtual std::string name() const = 0;
  // Time for which the first batch of bytes is collected before it goes onto the line, in microseconds.
  virtual int collect_us() const = 0;
};

// Shared by both kinds of port: read() and write() on a non-blocking descriptor.
std::vector<std::uint8_t> read_until_empty(int fd);
void write_or_lose(int fd, std::uint8_t byte);

}  // namespace card

#endif
