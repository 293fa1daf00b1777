// SPDX-License-Identifier: Apache-2.0
// A pseudo terminal in raw mode with a symbolic link to its other side.

#ifndef PTY_PORT_H
#define PTY_PORT_H

#include "byte_port.h"

namespace card {

class PtyPort : public BytePort {
 public:
  // Opens the pty; `link` empty: no link. Throws UserError if `link` already exists.
  explicit PtyPort(const std::string& link);
  // Removes the link if it still points to this pty.
  ~PtyPort() override;
  PtyPort(const PtyPort&) = delete;
  PtyPort& operator=(const PtyPort&) = delete;

  std::vector<std::uint8_t> read_all() override;
  void write(std::uint8_t byte) override;
  int fd() const override { return master_; }
  std::string name() const override { return link_.empty() ? device_ : link_; }
  int collect_us() const override { return 500; }

 private:
  void watch_clients();
  void close_all();

  std::string link_;
  std::string device_;  // /dev/pts/N
  int master_ = -1;
  int slave_ = -1;   // kept open: the pty stays raw and the master side never sees a hang-up
  int notify_ = -1;  // inotify: other programs that open and close device_
  int clients_ = 0;
};

}  // namespace card

#endif
