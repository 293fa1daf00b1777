// SPDX-License-Identifier: Apache-2.0

#include "serial_port.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "user_error.h"

namespace card {

namespace {

speed_t speed_constant(int baud) {
  switch (baud) {
    case 300: return B300;
    case 1200: return B1200;
    case 2400: return B2400;
    case 4800: return B4800;
    case 9600: return B9600;
    case 19200: return B19200;
    case 38400: return B38400;
    case 115200: return B115200;
    default: throw UserError("no serial port rate of " + std::to_string(baud) + " bit/s");
  }
}

}  // namespace

SerialPort::SerialPort(const std::string& device, const LineSettings& line) : device_(device) {
  fd_ = open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd_ < 0) throw system_error("cannot open " + device);
  try {
    if (tcgetattr(fd_, &before_) != 0) throw UserError(device + " is not a serial port");
    if (flock(fd_, LOCK_EX | LOCK_NB) != 0) throw UserError(device + " is in use by another program");
    termios settings = before_;
    cfmakeraw(&settings);
    settings.c_cflag &= ~static_cast<tcflag_t>(PARENB | PARODD | CSTOPB | CRTSCTS);
    settings.c_cflag |= CLOCAL | CREAD;
    if (line.parity != 'N') settings.c_cflag |= PARENB;
    if (line.parity == 'O') settings.c_cflag |= PARODD;
    if (line.stop_bits == 2) settings.c_cflag |= CSTOPB;
    cfsetispeed(&settings, speed_constant(line.baud));
    cfsetospeed(&settings, speed_constant(line.baud));
    if (tcsetattr(fd_, TCSANOW, &settings) != 0)
      throw system_error("cannot set " + device + " to " + line.name());
  } catch (...) {
    close(fd_);
    throw;
  }
}

SerialPort::~SerialPort() {
  tcsetattr(fd_, TCSANOW, &before_);
  close(fd_);
}

}  // namespace card
