// SPDX-License-Identifier: Apache-2.0
// --pcap: frames of both lines as a pcapng file with two interfaces, simulated time in microseconds.
//
// Interface 0 is the network line, link type 147 (USER0), 1 the drive line, link type 148 (USER1);
// sim/view/fc.lua tells Wireshark what they are. Their descriptions end with the line's rate and format and
// with the drive's name; a network line that changes its rate is another interface from then on. Direction as the card sees it: inbound from the master or
// the drive, outbound from the card. Each packet carries its description as comment, bad frames are marked
// there.

#ifndef PCAPNG_H
#define PCAPNG_H

#include <string>
#include <vector>

#include "frame.h"
#include "output_file.h"

namespace card {

class PcapngFile {
 public:
  // `drive`: whose parameters are on the drive line, for those who read the capture. Throws UserError.
  PcapngFile(const std::string& path, const SimClock& clock, const std::string& drive);
  // `settings`: rate and format of the network line, such as "9600 8N2"; empty: not known.
  void frame(const Frame& frame, const std::string& settings);
  void close(const std::string& settings);
  OutputFile& file() { return file_; }

 private:
  void begin(const std::string& settings);
  void network_interface(const std::string& settings);
  void block(std::uint32_t type, const std::vector<std::uint8_t>& body);
  void section_header();
  void interface(std::uint16_t link_type, const std::string& name, const std::string& description);

  const SimClock clock_;
  OutputFile file_;
  const std::string drive_;
  std::string settings_;
  std::uint32_t interfaces_ = 0;  // so many have been written
  std::uint32_t network_ = 0;     // the network line's now
};

}  // namespace card

#endif
