// SPDX-License-Identifier: Apache-2.0
// Generated from regs/fc.toml by `make regs`; edit that, not this one.

#ifndef FC_WORDS_H
#define FC_WORDS_H

namespace fc_words {

struct Fault {
  unsigned number;  // PWE low of a reply with AK 7
  const char* name;
};

constexpr Fault kFaults[] = {
    {0, "parameter does not exist"},
    {1, "no write access"},
    {2, "value exceeds limits"},
    {3, "sub-index does not exist"},
    {4, "parameter is no array"},
    {5, "data type does not match"},
    {6, "can only be reset"},
    {7, "cannot be changed"},
    {11, "no right to write"},
    {17, "not possible in the present mode"},
    {18, "other fault of the drive"},
    {130, "no bus access"},
    {131, "factory setup selected"},
};

}  // namespace fc_words

#endif
