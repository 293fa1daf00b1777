// SPDX-License-Identifier: Apache-2.0

#include "byte_port.h"

#include <unistd.h>

namespace card {

std::vector<std::uint8_t> read_until_empty(int fd) {
  std::vector<std::uint8_t> bytes;
  std::uint8_t chunk[512];
  ssize_t got;
  while ((got = ::read(fd, chunk, sizeof chunk)) > 0) bytes.insert(bytes.end(), chunk, chunk + got);
  return bytes;
}

void write_or_lose(int fd, std::uint8_t byte) {
  if (::write(fd, &byte, 1) != 1) return;  // buffer full: the other side does not read
}

}  // namespace card
