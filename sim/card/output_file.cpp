// SPDX-License-Identifier: Apache-2.0

#include "output_file.h"

#include "user_error.h"

namespace card {

OutputFile::OutputFile(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wbe")) {
  if (file_ == nullptr) throw system_error("cannot write " + path);
}

OutputFile::~OutputFile() { close(); }

void OutputFile::check(bool good) {
  if (!good && trouble_.empty()) trouble_ = system_error("cannot write " + path_).what();
}

void OutputFile::write(const void* data, std::size_t size) {
  check(std::fwrite(data, 1, size, file_) == size);
  check(std::fflush(file_) == 0);
}

void OutputFile::close() {
  if (file_ == nullptr) return;
  check(std::fclose(file_) == 0);
  file_ = nullptr;
}

}  // namespace card
