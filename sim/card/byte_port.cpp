// SPDX-License-Identifier: Apache-2.0

#include "byte_port.h"

#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <termios.h>
#include <unistd.h>

#include "user_error.h"

namespace card {

BytePort::~BytePort() {
  if (fd_ >= 0) close(fd_);
}

Bytes BytePort::read_all() {
  Bytes bytes;
  std::uint8_t chunk[512];
  ssize_t got;
  while ((got = ::read(fd_, chunk, sizeof chunk)) > 0) bytes.insert(bytes.end(), chunk, chunk + got);
  return bytes;
}

void BytePort::write(std::uint8_t byte) {
  if (::write(fd_, &byte, 1) != 1) return;  // buffer full: the other side does not read
}

namespace {

struct Descriptor {
  int fd = -1;
  ~Descriptor() {
    if (fd >= 0) close(fd);
  }
};

class PtyPort : public BytePort {
 public:
  explicit PtyPort(const std::string& link) : BytePort(500) {
    fd_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    char device[64];
    if (fd_ < 0 || grantpt(fd_) != 0 || unlockpt(fd_) != 0 || ptsname_r(fd_, device, sizeof device) != 0)
      throw system_error("cannot open a pseudo terminal");
    device_ = name_ = device;
    slave_.fd = open(device, O_RDWR | O_NOCTTY | O_CLOEXEC);
    termios raw{};
    if (slave_.fd < 0 || tcgetattr(slave_.fd, &raw) != 0) throw system_error("cannot open " + device_);
    cfmakeraw(&raw);
    if (tcsetattr(slave_.fd, TCSANOW, &raw) != 0) throw system_error("cannot set up " + device_);
    notify_.fd = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    if (notify_.fd < 0 || inotify_add_watch(notify_.fd, device, IN_OPEN | IN_CLOSE) < 0)
      throw system_error("cannot watch " + device_);
    if (!link.empty()) make_link(link);
  }

  // Removes the link if it still points to this pty.
  ~PtyPort() override {
    if (name_ != device_ && target_of(name_) == device_) unlink(name_.c_str());
  }

  Bytes read_all() override {
    watch_clients();
    return BytePort::read_all();
  }

  void write(std::uint8_t byte) override {
    watch_clients();
    if (clients_ > 0) BytePort::write(byte);
  }

 private:
  static std::string target_of(const std::string& link) {
    char target[PATH_MAX];
    const ssize_t length = readlink(link.c_str(), target, sizeof target);
    return length > 0 ? std::string(target, static_cast<std::size_t>(length)) : "";
  }

  void make_link(const std::string& link) {
    // A link to a pty that no longer exists is left over from a killed card: replace it.
    const std::string target = target_of(link);
    if (target.rfind("/dev/pts/", 0) == 0 && (target == device_ || access(target.c_str(), F_OK) != 0))
      unlink(link.c_str());
    if (symlink(device_.c_str(), link.c_str()) != 0) {
      if (errno == EEXIST) throw UserError(link + " exists already: remove it or choose another name");
      throw system_error("cannot make " + link);
    }
    name_ = link;
  }

  // A serial port discards bytes while no program has it open, but a pty keeps them for the next program. So
  // discard bytes sent while no program is connected, and bytes that the last program left unread.
  void watch_clients() {
    alignas(inotify_event) char buffer[1024];
    ssize_t got;
    while ((got = ::read(notify_.fd, buffer, sizeof buffer)) > 0) {
      for (ssize_t at = 0; at < got;) {
        const auto* event = reinterpret_cast<const inotify_event*>(buffer + at);
        if (event->mask & IN_OPEN) ++clients_;
        if (event->mask & IN_CLOSE && --clients_ == 0) tcflush(slave_.fd, TCIFLUSH);
        at += static_cast<ssize_t>(sizeof *event + event->len);
      }
    }
  }

  std::string device_;  // /dev/pts/N
  Descriptor slave_;    // kept open: the pty stays raw and the master side never sees a hang-up
  Descriptor notify_;   // inotify: other programs that open and close device_
  int clients_ = 0;
};

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

class SerialPort : public BytePort {
 public:
  // USB adapters deliver a frame in pieces up to 16 ms apart; on the simulated line it must have no gaps.
  SerialPort(const std::string& device, const LineSettings& line) : BytePort(20'000) {
    name_ = device;
    fd_ = open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd_ < 0) throw system_error("cannot open " + device);
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
  }

  ~SerialPort() override { tcsetattr(fd_, TCSANOW, &before_); }

 private:
  termios before_{};
};

}  // namespace

std::unique_ptr<BytePort> open_pty(const std::string& link) { return std::make_unique<PtyPort>(link); }

std::unique_ptr<BytePort> open_serial_port(const std::string& device, const LineSettings& line) {
  return std::make_unique<SerialPort>(device, line);
}

}  // namespace card
