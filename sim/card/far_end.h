// SPDX-License-Identifier: Apache-2.0
// The other end of a line: a foreign program at a port, or the simulated drive.

#pragma once

#include "byte_port.h"
#include "vlt_drive.h"

namespace card {

class FarEnd {
 public:
  virtual ~FarEnd() = default;
  // Called for each byte that the card has sent.
  virtual void from_card(const LineByte& byte) = 0;
  // Called several times a millisecond; may hand bytes to `line`.
  virtual void step(UartLine& line, Cycles now) = 0;
  // True while another program is expected to answer the card: simulated time must not outrun it.
  virtual bool answer_expected(Cycles) const { return false; }
  // Another rate and format of the line.
  virtual void use(const LineSettings&) {}
  // Descriptor that becomes readable when something arrives, or -1.
  virtual int fd() const { return -1; }
  virtual std::string name() const = 0;
};

// A foreign program. Bytes that arrive together go onto the line as one burst without gaps. A burst waits
// until the line has been silent for burst_gap. Bytes continue the previous burst if that burst is still on
// the line or has only just ended.
class PortFarEnd : public FarEnd {
 public:
  // `answer_time`: time the program may need to answer the card; 0: the program is a master.
  PortFarEnd(std::unique_ptr<BytePort> port, const LineSettings& settings, const SimClock& clock,
             Cycles answer_time);
  void from_card(const LineByte& byte) override;
  void step(UartLine& line, Cycles now) override;
  bool answer_expected(Cycles now) const override;
  void use(const LineSettings& settings) override;
  int fd() const override { return port_->fd(); }
  std::string name() const override { return port_->name(); }

 private:
  void arrived(const Bytes& bytes, UartLine& line, Cycles now);
  bool goes_on(const UartLine& line, Cycles now) const;

  std::unique_ptr<BytePort> port_;
  const SimClock clock_;
  LineSettings settings_;
  const Cycles collect_;  // silence after which a burst is complete
  Cycles pause_limit_ = 0;  // a longer pause between two arrivals starts a new burst
  const Cycles answer_time_;
  std::deque<Bytes> bursts_;  // not on the line yet
  std::size_t waiting_bytes_ = 0;
  Cycles last_arrival_ = 0;
  bool last_word_ours_ = false;  // the newest byte on the line came from here, not from the card
  Cycles answer_until_ = -1;
};

// The simulated drive: sim/drive with a UART and a response time.
class DriveEnd : public FarEnd {
 public:
  // `response_time`: silence between the card's telegram and the reply. `example`: the drive keeps the
  // state of its document's examples and ignores commands.
  DriveEnd(const drive_profile_t& profile, bool example, const LineSettings& settings, const SimClock& clock,
           Cycles response_time);
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
  const SimClock clock_;
  const LineSettings settings_;
  const Cycles response_time_;
  drive_t drive_{};
  Bytes telegram_;
  bool damaged_ = false;
  Cycles last_byte_end_ = 0;
  Bytes reply_;
  Cycles reply_due_ = kNever;
  std::int64_t stepped_us_ = 0;
};

}  // namespace card
