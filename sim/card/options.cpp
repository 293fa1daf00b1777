// SPDX-License-Identifier: Apache-2.0

#include "options.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <system_error>
#include <vector>

#include "user_error.h"

namespace card {

namespace {

constexpr const char* kDefaultBaudSwitches = "111110000";  // 9600 8N2
constexpr const char* kDefaultAddrSwitches = "10000000";   // address 1

double positive_seconds(const std::string& option, const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value) || value <= 0)
    throw UserError(option + " takes a number of seconds above 0, not '" + text + "'");
  return value;
}

// "a, b or c"
std::string listed(const std::vector<std::string>& names) {
  std::string text = names[0];
  for (std::size_t i = 1; i < names.size(); ++i) text += (i + 1 < names.size() ? ", " : " or ") + names[i];
  return text;
}

std::string dialect_names() {
  std::vector<std::string> names;
  for (const Dialect& dialect : kDialects) names.emplace_back(dialect.name);
  return listed(names);
}

std::string profile_names() {
  std::vector<std::string> names;
  for (std::size_t i = 0; drive_profile_name(i) != nullptr; ++i) names.emplace_back(drive_profile_name(i));
  return listed(names);
}

// What an option finds by a name.
template <typename Found>
Found one_of(const std::string& option, const std::string& names, const std::string& text, Found found) {
  if (!found) throw UserError(option + " is " + names + ", not '" + text + "'");
  return found;
}

struct Option {
  std::string name;
  bool takes_value;
  std::function<void(const std::string&)> set;
};

bool same_file(const std::string& one, const std::string& other) {
  if (other.empty()) return false;
  std::error_code unknown;
  return std::filesystem::weakly_canonical(std::filesystem::absolute(one), unknown) ==
         std::filesystem::weakly_canonical(std::filesystem::absolute(other), unknown);
}

void check_together(const Options& options) {
  if (!options.modbus_link.empty() && !options.modbus_device.empty())
    throw UserError("--modbus and --modbus-device exclude each other");
  if ((!options.drive_link.empty() || options.example) && !options.drive_device.empty())
    throw UserError("--drive and --drive-device exclude each other");
  if (options.dialect->images[options.image] == nullptr)
    throw UserError(std::string(kFlags[options.image - 1].name) + " has no image for the dialect " +
                    options.dialect->name);
  if (!options.real_time && (!options.modbus_device.empty() || !options.drive_device.empty()))
    throw UserError("--speed max does not go with a real serial port");
  if (!options.modbus_link.empty() && options.modbus_link == options.drive_link)
    throw UserError("--modbus and --drive need two different links");
  const std::string* const files[] = {&options.wave_file, &options.pcap_file, &options.log_file};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = i + 1; j < 3; ++j)
      if (!files[i]->empty() && same_file(*files[i], *files[j]))
        throw UserError("--wave, --pcap and --log need different files, not twice '" + *files[i] + "'");
}

// One line of the help below an option or its value.
std::string help_line(const std::string& name, const std::string& text) {
  return "  " + name + std::string(name.size() < 22 ? 23 - name.size() : 1, ' ') + text + "\n";
}

std::string dialect_help() {
  std::string text;
  for (const Dialect& dialect : kDialects)
    text += help_line("", std::string(dialect.name) + ": " + dialect.about + ", drive " + dialect.profile);
  return text;
}

std::string flag_help() {
  std::string text;
  for (std::size_t i = 1; i <= kFlags.size(); ++i) {
    std::string usual;
    std::string missing;
    for (const Dialect& dialect : kDialects) {
      if (dialect.images[i] == nullptr)
        missing += std::string(", not with ") + dialect.name;
      else if (std::string(dialect.images[i]) == dialect.images[0])
        usual += std::string(", default with ") + dialect.name;
    }
    text += help_line(kFlags[i - 1].name, kFlags[i - 1].help + usual + missing);
  }
  return text;
}

}  // namespace

unsigned switches(const std::string& option, const std::string& text, std::size_t count) {
  if (text.size() != count || text.find_first_not_of("01") != std::string::npos)
    throw UserError(option + " takes " + std::to_string(count) + " digits 0 or 1, switch 1 first, not '" +
                    text + "'");
  unsigned value = 0;
  for (std::size_t i = 0; i < count; ++i) value |= static_cast<unsigned>(text[i] - '0') << i;
  return value;
}

Options parse_options(int argc, char** argv) {
  Options options;
  options.dialect = &kDialects[0];
  options.sw_baud = switches("--sw-baud", kDefaultBaudSwitches, kBaudSwitches);
  options.sw_addr = switches("--sw-addr", kDefaultAddrSwitches, kAddrSwitches);
  const auto text = [](std::string& target) {
    return [&target](const std::string& value) { target = value; };
  };
  const auto flag = [](bool& target) { return [&target](const std::string&) { target = true; }; };
  std::vector<Option> known = {
      {"--modbus", true, text(options.modbus_link)},
      {"--modbus-device", true, text(options.modbus_device)},
      {"--drive", true,
       [&](const std::string& v) {
         options.example = v == "example";
         options.drive_link = v == "sim" || options.example ? "" : v;
       }},
      {"--drive-device", true, text(options.drive_device)},
      {"--profile", true,
       [&](const std::string& v) {
         options.profile = one_of("--profile", profile_names(), v, drive_profile(v.c_str()));
       }},
      {"--dialect", true,
       [&](const std::string& v) { options.dialect = one_of("--dialect", dialect_names(), v, find_dialect(v)); }},
      {"--sw-baud", true, [&](const std::string& v) { options.sw_baud = switches("--sw-baud", v, kBaudSwitches); }},
      {"--sw-addr", true, [&](const std::string& v) { options.sw_addr = switches("--sw-addr", v, kAddrSwitches); }},
      {"--speed", true,
       [&](const std::string& v) {
         one_of("--speed", "real or max", v, v == "real" || v == "max");
         options.real_time = v == "real";
       }},
      {"--for", true, [&](const std::string& v) { options.seconds = positive_seconds("--for", v); }},
      {"--wave", true, text(options.wave_file)},
      {"--pcap", true, text(options.pcap_file)},
      {"--log", true, text(options.log_file)},
      {"--control", false, flag(options.control)},
      {"--quiet", false, flag(options.quiet)},
      {"--help", false, flag(options.help)},
      {"--version", false, flag(options.version)},
  };
  for (std::size_t i = 1; i <= kFlags.size(); ++i)
    known.push_back({kFlags[i - 1].name, false, [&options, i](const std::string&) {
                       if (options.image != 0 && options.image != i)
                         throw UserError(std::string(kFlags[options.image - 1].name) + " and " +
                                         kFlags[i - 1].name + " exclude each other: no image has both");
                       options.image = i;
                     }});
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    const Option* option = nullptr;
    for (const Option& candidate : known)
      if (candidate.name == name) option = &candidate;
    if (option == nullptr) throw UserError("unknown option '" + argument + "' (--help lists them)");
    if (!option->takes_value) {
      if (equals != std::string::npos) throw UserError(name + " takes no value");
      option->set("");
      continue;
    }
    const bool follows = equals == std::string::npos;
    if (follows && i + 1 >= argc) throw UserError(name + " needs a value");
    const std::string value = follows ? argv[++i] : argument.substr(equals + 1);
    if (value.empty()) throw UserError(name + " needs a value");
    // Catches a missing value before an option; a file of such a name can be given as './--name'.
    if (follows && value.rfind("--", 0) == 0)
      throw UserError(name + " needs a value, and '" + value + "' is an option");
    option->set(value);
  }
  check_together(options);
  if (options.profile == nullptr) options.profile = drive_profile(options.dialect->profile);
  return options;
}

std::string help_text() {
  return "usage: card [options]\n"
         "The virtual card: the Verilated rtu2fc card with its firmware and two serial lines.\n"
         "\n"
         "network line (Modbus RTU master)\n"
         "  --modbus LINK          open a pty and make LINK a symbolic link to it, removed at the end\n"
         "  --modbus-device DEV    use a real serial port, set to the switches' rate and parity\n"
         "                         (neither: a pty without link, named in the ready line)\n"
         "drive line (FC protocol, 9600 8E1)\n"
         "  --drive sim            the simulated drive (default)\n"
         "  --drive example        the simulated drive in the state of its document's examples\n"
         "  --drive LINK           a pty for a foreign drive\n"
         "  --drive-device DEV     use a real serial port\n"
         "  --profile NAME         the simulated drive, and the names of a drive's parameters in words:\n"
         "                         " + profile_names() + "\n"
         "card\n"
         "  --dialect NAME         firmware of the card, by default the first one:\n" + dialect_help() + flag_help() +
         "  --sw-baud 111110000    rate and parity switches, switch 1 first, 1 = ON (default 9600 8N2)\n"
         "  --sw-addr 10000000     address switches, switch 1 first, 1 = ON (default address 1)\n"
         "time\n"
         "  --speed real|max       real (default): simulated time follows wall time; max: as fast as it "
         "can,\n"
         "                         but no faster than real time while a foreign drive is to answer\n"
         "  --for SECONDS          stop after so many simulated seconds (default: run until Ctrl-C)\n"
         "output\n"
         "  --wave FILE.fst        waveform of the card (some 20 MB a simulated second, and slower)\n"
         "  --pcap FILE.pcapng     frames of both lines for Wireshark\n"
         "  --log FILE.jsonl       frames and LED changes, one JSON object a line\n"
         "  --quiet                no frames on the terminal, only 'ready' and errors\n"
         "control\n"
         "  --control              take commands from standard input, one a line, and answer each with one "
         "line;\n"
         "                         'help' lists them; the end of the input ends the card\n"
         "other\n"
         "  --help, --version\n"
         "\n"
         "Prints 'ready modbus=... drive=...' when both lines are open. SIGINT, SIGTERM and --for end it "
         "with\n"
         "exit code 0; a wrong option, a busy path or a full disk is one line and exit code 2.\n";
}

}  // namespace card
