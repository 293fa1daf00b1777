// SPDX-License-Identifier: Apache-2.0
// The harness as a library: a Verilated card whose input edges a caller sets and whose output edges it takes.
//
// The caller is sim/harness/simulated_card.py, through ctypes. Built with CARD_WAVES it writes a waveform; built
// with CARD_FLIPS the caller finds the registers by name and can flip any bit of them during the run.
#include <cstddef>
#include <cstdint>

#include "card_model.h"
#include "line_player.h"

namespace {

using harness::Clocks;
using harness::Edge;

class Card {
 public:
  // reset: the card goes through its reset here; else the caller drives rst_n.
  Card(const harness::PowerUp& how, unsigned watched, bool reset, const char* wave)
      : model_(how), player_(model_, watched) {
#ifdef CARD_WAVES
    if (wave != nullptr) model_.open_wave(wave);
#else
    static_cast<void>(wave);
#endif
    model_.power_on();
    if (reset) player_.reset([this] { step(); });
  }

  harness::LinePlayer& player() { return player_; }
  const harness::CardModel& model() const { return model_; }

  Clocks run(Clocks until, unsigned rising, unsigned falling) {
    return player_.run(until, rising, falling, [this] { step(); });
  }

#ifdef CARD_FLIPS
  const std::vector<harness::Variable>& variables() { return model_.variables(); }
  void flip(std::size_t variable, std::uint32_t word, std::uint32_t bit) {
    model_.flip(variable, word, bit);
    player_.settle();
  }
  void watch(std::size_t variable) { nonzero_ = variables().at(variable).data; }
  std::uint64_t watched() const { return nonzero_clocks_; }
#endif

 private:
  void step() {
#ifdef CARD_WAVES
    if (model_.has_wave()) {
      const auto half = static_cast<std::uint64_t>(2 * (player_.now() + harness::kResetClocks));
      model_.clock_into_wave(half, half + 1);
      return;
    }
#endif
    model_.clock();
#ifdef CARD_FLIPS
    nonzero_clocks_ += nonzero_ != nullptr && *nonzero_ != 0;
#endif
  }

  harness::CardModel model_;
  harness::LinePlayer player_;
#ifdef CARD_FLIPS
  const unsigned char* nonzero_ = nullptr;
  std::uint64_t nonzero_clocks_ = 0;
#endif
};

Card* as_card(void* card) { return static_cast<Card*>(card); }

}  // namespace

extern "C" {

// The firmware image is read from the working directory. watched: signals whose edges are kept. wave: FST file,
// for a build with CARD_WAVES, or null.
void* card_open(unsigned sw_baud, unsigned sw_addr, int seed, unsigned watched, int reset, const char* wave) {
  return new Card({sw_baud, sw_addr, seed}, watched, reset != 0, wave);
}
void card_close(void* card) { delete as_card(card); }
std::int64_t card_now(void* card) { return as_card(card)->player().now(); }
void card_play(void* card, std::size_t input, const Edge* edges, std::size_t count) {
  as_card(card)->player().play(input, edges, count);
}
void card_hush(void* card, std::size_t line) { as_card(card)->player().hush(line); }
std::int64_t card_run(void* card, std::int64_t until, unsigned rising, unsigned falling) {
  return as_card(card)->run(until, rising, falling);
}
std::size_t card_take_edges(void* card, Edge* out, std::size_t room) {
  return as_card(card)->player().take_edges(out, room);
}
std::uint32_t card_memory_word(void* card, std::size_t word) { return as_card(card)->model().memory_word(word); }

#ifdef CARD_FLIPS
std::size_t card_variables(void* card) { return as_card(card)->variables().size(); }
const char* card_variable(void* card, std::size_t i, std::uint32_t* words, std::uint32_t* bits) {
  const harness::Variable& v = as_card(card)->variables().at(i);
  *words = v.words;
  *bits = v.bits;
  return v.name.c_str();
}
// From now on counts the clocks in which this variable is not 0.
void card_watch(void* card, std::size_t i) { as_card(card)->watch(i); }
std::uint64_t card_watched(void* card) { return as_card(card)->watched(); }
void card_flip(void* card, std::size_t i, std::uint32_t word, std::uint32_t bit) {
  as_card(card)->flip(i, word, bit);
}
// A number of all that the model holds. It has addresses in it: compare it within a process and its forks only.
std::uint64_t card_digest(void* card) { return as_card(card)->model().digest(); }
#endif
}
