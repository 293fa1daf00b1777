// SPDX-License-Identifier: Apache-2.0
// Error that the user can correct: printed as one line, exit code 2.

#pragma once

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

namespace card {

struct UserError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// UserError "<what>: <text of errno>".
inline UserError system_error(const std::string& what) {
  return UserError(what + ": " + std::strerror(errno));
}

}  // namespace card
