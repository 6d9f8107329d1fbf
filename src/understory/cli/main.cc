#include <fcntl.h>
#include <malloc.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "understory/cli/command.h"
#include "understory/cli/given_runs.h"
#include "understory/cli/outcome.h"
#include "understory/cli/suggestion.h"
#include "understory/cli/terminal.h"
#include "understory/util/error.h"
#include "understory/util/files/staged_output.h"
#include "understory/util/parallel.h"
#include "understory/util/version.h"

namespace understory {
namespace {

int complain(int code, const std::string& message) {
  std::fprintf(stderr, "error: %s\n", message.c_str());
  return code;
}

// Large arrays are made and freed for every scan. By default the C library gives their pages back
// each time, and the system clears them anew: 4 % of the time of `map`.
void keep_freed_memory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
  mallopt(M_TOP_PAD, 16 << 20);
}

// A file that is opened takes the lowest free descriptor. Where the caller closed one of the first
// three, the words of the program would go into that file.
void keep_standard_streams() {
  for (int descriptor = 0; descriptor < 3; ++descriptor) {
    if (fcntl(descriptor, F_GETFD) >= 0) continue;
    // Those below are open, so this takes the place.
    if (open("/dev/null", descriptor == 0 ? O_RDONLY : O_WRONLY) < 0) std::abort();
  }
}

// What was printed may wait in memory until now: a full disk behind `> FILE` would lose it in
// silence. A stdout that the user closed is no error.
int with_printed(int code) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  if (errno == EBADF) return code;
  return complain(kExitBadInput, std::string("what is printed cannot be written: ") +
                                     std::strerror(errno == 0 ? EIO : errno));
}

// The one place where errors become exit codes.
int run_guarded(const Command& command, CommandContext& context) {
  try {
    int code = kExitDone;
    with_threads(context.threads, [&] { code = command(context); });
    return code;
  } catch (const Stopped&) {
    return report_stop("nothing was written, and what was there before is as it was");
  } catch (const ConfigError& error) {
    return complain(kExitUsage, error.what());
  } catch (const InputError& error) {
    return complain(kExitBadInput, with_final_names(error.what()));
  } catch (const OutputError& error) {
    return complain(kExitBadInput, with_final_names(error.what()));
  } catch (const std::bad_alloc&) {
    return complain(kExitDefect, "out of memory");
  } catch (const std::exception& error) {
    return complain(kExitDefect,
                    std::string("a defect of the program, please report it: ") + error.what());
  }
}

// "nan" and "inf" are numbers to the parser, and no range refuses the first.
void check_finite(const CLI::App& command) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_type_name().rfind("FLOAT", 0) != 0) continue;
    for (const std::string& given : option->results()) {
      if (!std::isfinite(std::strtod(given.c_str(), nullptr)))
        throw CLI::ValidationError(option->get_name(), given + " is no finite number");
    }
  }
  for (const CLI::App* chosen : command.get_subcommands())
    check_finite(*chosen);
}

std::string names_of_commands(const CLI::App& app) {
  std::string list;
  for (const CLI::App* command : app.get_subcommands({}))
    list += (list.empty() ? "" : ", ") + command->get_name();
  return list;
}

// The commands that were named, one below the other.
struct Chosen {
  std::vector<const CLI::App*> commands;  // the program first
  std::string name;                       // "evaluate trees"; empty where none was named
};

Chosen chosen_of(const CLI::App& app) {
  Chosen chosen{{&app}, ""};
  while (!chosen.commands.back()->get_subcommands().empty()) {
    chosen.commands.push_back(chosen.commands.back()->get_subcommands().front());
    chosen.name += (chosen.name.empty() ? "" : " ") + chosen.commands.back()->get_name();
  }
  return chosen;
}

std::string help_of(const Chosen& chosen) {
  return " (understory " + chosen.name + (chosen.name.empty() ? "--help)" : " --help)");
}

// Where the command stands: the first word that is neither an option of the program nor its value.
std::size_t place_of_command(const std::vector<const char*>& words) {
  std::size_t k = 1;
  for (; k < words.size(); ++k) {
    const std::string_view word = words[k];
    if (word == "--threads")
      ++k;  // and its value
    else if (!word.empty() && word.front() != '-')
      return k;
  }
  return k;
}

// The parser only says that a command is missing. Empty if one is named or none is tried.
std::string unknown_command(const CLI::App& app, const std::vector<const char*>& words) {
  const std::size_t place = place_of_command(words);
  if (place >= words.size()) return {};
  const std::string word = words[place];
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({}))
    names.push_back(command->get_name());
  if (std::find(names.begin(), names.end(), word) != names.end()) return {};
  const std::string meant = nearest_word(word, names);
  return "there is no command '" + word + "'" +
         (meant.empty() ? "; the commands are: " + names_of_commands(app)
                        : "; did you mean '" + meant + "'?") +
         " (understory --help)";
}

// The first option that the command does not have, and the nearest one that it has; empty if each
// is known.
std::string unknown_option(const CLI::App& app, const std::vector<const char*>& words) {
  const Chosen chosen = chosen_of(app);
  std::vector<std::string> names;
  for (const CLI::App* each : chosen.commands) {
    for (const CLI::Option* option : each->get_options()) {
      for (const std::string& name : option->get_lnames())
        names.push_back("--" + name);
    }
  }
  for (std::size_t k = 1; k < words.size(); ++k) {
    const std::string given = words[k];
    const std::string word = given.substr(0, given.find('='));
    if (word.rfind("--", 0) != 0 || std::find(names.begin(), names.end(), word) != names.end())
      continue;
    const std::string meant = nearest_word(word, names);
    return (chosen.name.empty() ? "understory" : chosen.name) + " has no option '" + word + "'" +
           (meant.empty() ? "" : "; did you mean '" + meant + "'?") + help_of(chosen);
  }
  return {};
}

// What the parser says, as the program's own messages are: with the page that helps.
std::string with_help(const CLI::App& app, const std::string& said) {
  const Chosen chosen = chosen_of(app);
  const CLI::App& last = *chosen.commands.back();
  const bool lacks_command = last.get_require_subcommand_min() > 0;
  return (lacks_command ? "expected a command: " + names_of_commands(last) : said) +
         help_of(chosen);
}

// "help map" is "map --help", also behind the program's own options.
std::vector<const char*> with_help_as_option(int argc, char** argv) {
  std::vector<const char*> words(argv, argv + argc);
  const std::size_t place = place_of_command(words);
  if (place >= words.size() || std::string_view(words[place]) != "help") return words;
  words.erase(words.begin() + static_cast<std::ptrdiff_t>(place));
  words.push_back("--help");
  return words;
}

int run(int argc, char** argv) {
  keep_freed_memory();
  CLI::App app{"Lidar SLAM and tree mapping under the forest canopy", "understory"};
  app.set_version_flag("--version", kVersion);
  app.require_subcommand(1);
  app.fallthrough();
  int threads = 0;
  bool quiet = false;
  bool verbose = false;
  app.add_option("--threads", threads, "Threads to use (0 = all of the machine)")
      ->check(CLI::Range(0, 1024));
  app.add_flag("--quiet", quiet, "No progress and no information on stderr");
  app.add_flag("--verbose", verbose, "Debug messages on stderr");
  Command chosen;
  // In the order of the help page; each lives in a file of its own.
  add_demo_command(app, chosen);
  add_map_command(app, chosen);
  add_correct_command(app, chosen);
  add_info_command(app, chosen);
  add_convert_command(app, chosen);
  add_simulate_command(app, chosen);
  add_register_command(app, chosen);
  add_inventory_command(app, chosen);
  add_evaluate_command(app, chosen);
  add_merge_command(app, chosen);
  add_georeference_command(app, chosen);
  add_calibrate_command(app, chosen);
  app.footer("`understory COMMAND --help` shows the options of a command, with an example.");
  const std::vector<const char*> words = with_help_as_option(argc, argv);
  if (const std::string complaint = unknown_command(app, words); !complaint.empty())
    return complain(kExitUsage, complaint);
  try {
    app.parse(static_cast<int>(words.size()), words.data());
    check_finite(app);
  } catch (const CLI::ExtrasError& error) {
    const std::string complaint = unknown_option(app, words);
    return complain(kExitUsage, complaint.empty() ? with_help(app, error.what()) : complaint);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) return complain(kExitUsage, with_help(app, error.what()));
    return with_printed(app.exit(error));  // --help, --version
  }
  Log log(terminal_log(verbose, quiet));
  CommandContext context{log, terminal_progress(quiet), install_stop_handler(), threads,
                         stop_at_once};
  const Command checked = [&](CommandContext& given) {
    check_given_runs(app, given.log);
    return chosen(given);
  };
  return with_printed(run_guarded(checked, context));
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  understory::keep_standard_streams();
  return understory::run(argc, argv);
}
