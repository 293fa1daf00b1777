// SPDX-License-Identifier: Apache-2.0
// An output file of a recording. Each write is flushed, so that other programs can read along. A write error,
// such as a full disk, is kept until trouble() is called.

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
  // First error in one line, or empty.
  const std::string& trouble() const { return trouble_; }

 private:
  void check(bool good);

  const std::string path_;
  std::FILE* file_;
  std::string trouble_;
};

}  // namespace card

#endif
