// SPDX-License-Identifier: Apache-2.0
// --pcap: frames of both lines as a pcapng file with two interfaces, simulated time in microseconds.
//
// Interface 0 is the network line, link type 147 (USER0); interface 1 is the drive line, link type 148
// (USER1). sim/view/fc.lua dissects both. An interface description ends with the line's rate and format and
// with the drive's name. When the network line changes its rate, a new interface follows. Direction is the
// card's: inbound from master or drive, outbound from the card. A packet's comment is the frame's
// description and marks bad frames.

#ifndef PCAPNG_H
#define PCAPNG_H

#include <string>
#include <vector>

#include "frame.h"
#include "output_file.h"

namespace card {

class PcapngFile {
 public:
  // `drive`: name of the drive, for readers of the capture. Throws UserError.
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
  std::uint32_t interfaces_ = 0;  // number written
  std::uint32_t network_ = 0;     // current interface of the network line
};

}  // namespace card

#endif
