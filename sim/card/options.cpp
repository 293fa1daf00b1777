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
constexpr const char* kDialects = "card, builtin or hvac_basic";
constexpr const char* kProfiles = "vlt6000, vlt5000, vlt2800, vlt8000 or hvac_basic";
constexpr std::size_t kBaudSwitches = 9;
constexpr std::size_t kAddrSwitches = 8;

unsigned switches(const std::string& option, const std::string& text, std::size_t count) {
  if (text.size() != count || text.find_first_not_of("01") != std::string::npos)
    throw UserError(option + " takes " + std::to_string(count) + " digits 0 or 1, switch 1 first, not '" +
                    text + "'");
  unsigned value = 0;
  for (std::size_t i = 0; i < count; ++i) value |= static_cast<unsigned>(text[i] - '0') << i;
  return value;
}

double positive_seconds(const std::string& option, const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value) || value <= 0)
    throw UserError(option + " takes a number of seconds above 0, not '" + text + "'");
  return value;
}

bool is_real(const std::string& option, const std::string& text) {
  if (text != "real" && text != "max") throw UserError(option + " is real or max, not '" + text + "'");
  return text == "real";
}

const Dialect* dialect(const std::string& option, const std::string& text) {
  const Dialect* const found = find_dialect(text);
  if (found == nullptr) throw UserError(option + " is " + kDialects + ", not '" + text + "'");
  return found;
}

const drive_profile_t* profile(const std::string& option, const std::string& text) {
  const drive_profile_t* const found = drive_profile(text.c_str());
  if (found == nullptr) throw UserError(option + " is " + kProfiles + ", not '" + text + "'");
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
  if (options.trip_seconds > 0 && !(options.drive_link.empty() && options.drive_device.empty()))
    throw UserError("--trip is for the simulated drive");
  if (options.status_refresh && options.no_status_refresh)
    throw UserError("--status-refresh and --no-status-refresh exclude each other");
  if ((options.status_refresh || options.no_status_refresh) && options.master_loss_stop)
    throw UserError("--master-loss-stop takes the status refresh of the dialect: no image has another one");
  if (options.master_loss_stop && options.dialect->name == std::string("hvac_basic"))
    throw UserError("--master-loss-stop has no image for the dialect hvac_basic");
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

}  // namespace

unsigned baud_switches(const std::string& option, const std::string& text) {
  return switches(option, text, kBaudSwitches);
}

unsigned addr_switches(const std::string& option, const std::string& text) {
  return switches(option, text, kAddrSwitches);
}

Options parse_options(int argc, char** argv) {
  Options options;
  options.dialect = &default_dialect();
  options.sw_baud = switches("--sw-baud", kDefaultBaudSwitches, kBaudSwitches);
  options.sw_addr = switches("--sw-addr", kDefaultAddrSwitches, kAddrSwitches);
  const auto text = [](std::string& target) {
    return [&target](const std::string& value) { target = value; };
  };
  const auto flag = [](bool& target) { return [&target](const std::string&) { target = true; }; };
  const std::vector<Option> known = {
      {"--modbus", true, text(options.modbus_link)},
      {"--modbus-device", true, text(options.modbus_device)},
      {"--drive", true,
       [&](const std::string& v) {
         options.example = v == "example";
         options.drive_link = v == "sim" || options.example ? "" : v;
       }},
      {"--trip", true, [&](const std::string& v) { options.trip_seconds = positive_seconds("--trip", v); }},
      {"--drive-device", true, text(options.drive_device)},
      {"--profile", true, [&](const std::string& v) { options.profile = profile("--profile", v); }},
      {"--dialect", true, [&](const std::string& v) { options.dialect = dialect("--dialect", v); }},
      {"--status-refresh", false, flag(options.status_refresh)},
      {"--no-status-refresh", false, flag(options.no_status_refresh)},
      {"--master-loss-stop", false, flag(options.master_loss_stop)},
      {"--sw-baud", true,
       [&](const std::string& v) { options.sw_baud = baud_switches("--sw-baud", v); }},
      {"--sw-addr", true,
       [&](const std::string& v) { options.sw_addr = addr_switches("--sw-addr", v); }},
      {"--speed", true, [&](const std::string& v) { options.real_time = is_real("--speed", v); }},
      {"--for", true, [&](const std::string& v) { options.seconds = positive_seconds("--for", v); }},
      {"--wave", true, text(options.wave_file)},
      {"--pcap", true, text(options.pcap_file)},
      {"--log", true, text(options.log_file)},
      {"--control", false, flag(options.control)},
      {"--quiet", false, flag(options.quiet)},
      {"--help", false, flag(options.help)},
      {"--version", false, flag(options.version)},
  };
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

const char* help_text() {
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
         "  --trip SECONDS         let the simulated drive trip (overcurrent) after so many simulated seconds\n"
         "  --drive LINK           a pty for a foreign drive\n"
         "  --drive-device DEV     use a real serial port\n"
         "  --profile NAME         the simulated drive, and the names of a drive's parameters in words:\n"
         "                         vlt6000 (default), vlt5000, vlt2800, vlt8000, hvac_basic (default with\n"
         "                         the dialect of that name)\n"
         "card\n"
         "  --dialect NAME         firmware of the card: card (default, the option card's own), builtin\n"
         "                         (as VLT 2800, 6000, 8000 with Modbus built in), hvac_basic (as the VLT\n"
         "                         HVAC Basic Drive)\n"
         "  --status-refresh       a read of coils 33-64 asks the drive first (default with the dialects\n"
         "                         builtin and hvac_basic)\n"
         "  --no-status-refresh    it reads the status of the drive's last reply (default with card)\n"
         "  --master-loss-stop     the drive is stopped when no good frame comes for the time of 40002 (an\n"
         "                         image of its own; not hvac_basic)\n"
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
