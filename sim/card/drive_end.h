// SPDX-License-Identifier: Apache-2.0
// The simulated drive at the far end of the drive line: sim/drive with a UART and a response time.

#ifndef DRIVE_END_H
#define DRIVE_END_H

#include "far_end.h"
#include "vlt_drive.h"

namespace card {

class DriveEnd : public FarEnd {
 public:
  // `response_time`: silence between the card's telegram and the reply. `example`: the drive keeps the
  // state of its document's examples and ignores commands. `trip_us`: time of the trip in simulated
  // microseconds; 0: never.
  DriveEnd(const drive_profile_t& profile, bool example, std::int64_t trip_us, const LineSettings& settings,
           const SimClock& clock, Cycles response_time);
  void from_card(const LineByte& byte) override;
  void step(UartLine& line, Cycles now) override;
  std::string name() const override { return name_; }
  // `alarm`: 1 to 99. No effect while the drive is already tripped.
  void trip(std::uint8_t alarm) { drive_trip(&drive_, alarm); }
  void power_cycle();
  const drive_t& drive() const { return drive_; }

 private:
  bool complete() const;
  void take_telegram();
  void let_time_pass(Cycles until);

  const std::string name_;
  std::int64_t trip_us_;
  const SimClock clock_;
  const LineSettings settings_;
  const Cycles response_time_;
  drive_t drive_{};
  std::vector<std::uint8_t> telegram_;
  bool damaged_ = false;
  Cycles last_byte_end_ = 0;
  std::vector<std::uint8_t> reply_;
  Cycles reply_due_ = kNever;
  std::int64_t stepped_us_ = 0;
};

}  // namespace card

#endif
