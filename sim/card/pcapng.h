// SPDX-License-Identifier: Apache-2.0
// --pcap: frames of both lines as a pcapng file with two interfaces, simulated time in microseconds.
//
// Interface 0 is the network line, link type 147 (USER0), 1 the drive line, link type 148 (USER1);
// tools/wireshark tells Wireshark what they are. Direction as the card sees it: inbound from the master or
// the drive, outbound from the card. Each packet carries its description as comment, bad frames are marked
// there.

#ifndef PCAPNG_H
#define PCAPNG_H

#include <cstdio>
#include <string>
#include <vector>

#include "frame.h"

namespace card {

class PcapngFile {
 public:
  // `drive`: whose parameters are on the drive line, for those who read the capture. Throws UserError.
  PcapngFile(const std::string& path, const SimClock& clock, const std::string& drive);
  ~PcapngFile();
  PcapngFile(const PcapngFile&) = delete;
  PcapngFile& operator=(const PcapngFile&) = delete;
  void frame(const Frame& frame);

 private:
  void block(std::uint32_t type, const std::vector<std::uint8_t>& body);
  void section_header();
  void interface(std::uint16_t link_type, const std::string& name, const std::string& description);

  const SimClock clock_;
  std::FILE* file_;
};

}  // namespace card

#endif
