#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// Exit codes of the program (design: command line).
inline constexpr int kExitDone = 0;
inline constexpr int kExitDefect = 1;
inline constexpr int kExitUsage = 2;
inline constexpr int kExitBadInput = 3;
inline constexpr int kExitUntrusted = 4;

// The meaning of --overwrite for commands that write a folder of results.
inline constexpr const char* kOverwriteMeaning =
    "Replace the results that an earlier run left in the folder";

// --set key=value, which may be given several times. Each takes one value, so that a recording or a
// cloud may follow it.
inline void add_settings_option(CLI::App& command, std::vector<std::string>& settings) {
  command.add_option("--set", settings, "One setting, key=value (may be repeated)")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false)
      ->take_all();
}

// What every subcommand is given: messages and progress go to stderr, results to stdout.
struct CommandContext {
  Log& log;
  ProgressSink progress;
  StopRequested stop_requested;  // true after Ctrl-C
  int threads = 0;               // 0 = all of the machine
  // A command that writes no files calls it first: from then on Ctrl-C needs no clean end.
  std::function<void()> stop_at_once = [] {};

  // For work that has no result before its end: Ctrl-C ends it by Stopped.
  [[nodiscard]] ProgressSink until_stopped() const { return progress.stopped_by(stop_requested); }
};

// The work of the chosen subcommand; returns an exit code or throws an Error.
using Command = std::function<int(CommandContext&)>;

// Each subcommand is one file with one function that adds it to the program. It has its options, a
// footer with an example, and a callback that sets `chosen`.
void add_map_command(CLI::App& app, Command& chosen);
void add_demo_command(CLI::App& app, Command& chosen);
void add_correct_command(CLI::App& app, Command& chosen);
void add_info_command(CLI::App& app, Command& chosen);
void add_convert_command(CLI::App& app, Command& chosen);
void add_simulate_command(CLI::App& app, Command& chosen);
void add_register_command(CLI::App& app, Command& chosen);
void add_inventory_command(CLI::App& app, Command& chosen);
void add_georeference_command(CLI::App& app, Command& chosen);
void add_merge_command(CLI::App& app, Command& chosen);
void add_calibrate_command(CLI::App& app, Command& chosen);
void add_evaluate_command(CLI::App& app, Command& chosen);

}  // namespace understory
