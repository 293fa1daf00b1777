// SPDX-License-Identifier: Apache-2.0

#include "pty_port.h"

#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/inotify.h>
#include <termios.h>
#include <unistd.h>

#include "user_error.h"

namespace card {

PtyPort::PtyPort(const std::string& link) {
  try {
    master_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    char device[64];
    if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0 ||
        ptsname_r(master_, device, sizeof device) != 0)
      throw system_error("cannot open a pseudo terminal");
    device_ = device;
    slave_ = open(device, O_RDWR | O_NOCTTY | O_CLOEXEC);
    termios raw{};
    if (slave_ < 0 || tcgetattr(slave_, &raw) != 0) throw system_error("cannot open " + device_);
    cfmakeraw(&raw);
    if (tcsetattr(slave_, TCSANOW, &raw) != 0) throw system_error("cannot set up " + device_);
    notify_ = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    if (notify_ < 0 || inotify_add_watch(notify_, device, IN_OPEN | IN_CLOSE) < 0)
      throw system_error("cannot watch " + device_);
    if (!link.empty()) {
      // A link to a pty that no longer exists is left over from a killed card: replace it.
      char target[PATH_MAX] = {};
      if (readlink(link.c_str(), target, sizeof target - 1) > 0 && strncmp(target, "/dev/pts/", 9) == 0 &&
          (device_ == target || access(target, F_OK) != 0))
        unlink(link.c_str());
      if (symlink(device, link.c_str()) != 0) {
        if (errno == EEXIST) throw UserError(link + " exists already: remove it or choose another name");
        throw system_error("cannot make " + link);
      }
      link_ = link;
    }
  } catch (...) {
    close_all();
    throw;
  }
}

PtyPort::~PtyPort() {
  if (!link_.empty()) {
    char target[64];
    const ssize_t length = readlink(link_.c_str(), target, sizeof target);
    if (length > 0 && device_ == std::string(target, static_cast<std::size_t>(length))) unlink(link_.c_str());
  }
  close_all();
}

void PtyPort::close_all() {
  for (int fd : {notify_, slave_, master_})
    if (fd >= 0) close(fd);
}

// A serial port discards bytes while no program has it open, but a pty keeps them for the next program. So
// discard bytes sent while no program is connected, and bytes that the last program left unread.
void PtyPort::watch_clients() {
  alignas(inotify_event) char buffer[1024];
  ssize_t got;
  while ((got = ::read(notify_, buffer, sizeof buffer)) > 0) {
    for (ssize_t at = 0; at < got;) {
      const auto* event = reinterpret_cast<const inotify_event*>(buffer + at);
      if (event->mask & IN_OPEN) ++clients_;
      if (event->mask & IN_CLOSE && --clients_ == 0) tcflush(slave_, TCIFLUSH);
      at += static_cast<ssize_t>(sizeof *event + event->len);
    }
  }
}

std::vector<std::uint8_t> PtyPort::read_all() {
  watch_clients();
  return read_until_empty(master_);
}

void PtyPort::write(std::uint8_t byte) {
  watch_clients();
  if (clients_ > 0) write_or_lose(master_, byte);
}

}  // namespace card
