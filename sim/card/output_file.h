// SPDX-License-Identifier: Apache-2.0
// A file of a recording: what is written is there at once, others read along, and a full disk is not lost on
// anybody. It may fill up at any frame, so trouble is kept until somebody asks.

#ifndef OUTPUT_FILE_H
#define OUTPUT_FILE_H

#include <cstdio>
#include <string>

namespace card {

class OutputFile {
 public:
  explicit OutputFile(const std::string& path);  // throws UserError
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(const void* data, std::size_t size);
  void close();
  // Empty, or the first thing that went wrong, in a line.
  const std::string& trouble() const { return trouble_; }

 private:
  void check(bool good);

  const std::string path_;
  std::FILE* file_;
  std::string trouble_;
};

}  // namespace card

#endif
