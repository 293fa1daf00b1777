// SPDX-License-Identifier: Apache-2.0

#include "dialect.h"

namespace card {

namespace {
constexpr Dialect kDialects[] = {
    {"card", "", "vlt6000", false},
    {"builtin", "/builtin", "vlt6000", false},
    {"hvac_basic", "/hvac_basic", "hvac_basic", true},
};
}  // namespace

const Dialect* find_dialect(const std::string& name) {
  for (const Dialect& dialect : kDialects)
    if (name == dialect.name) return &dialect;
  return nullptr;
}

const Dialect& default_dialect() { return kDialects[0]; }

}  // namespace card
