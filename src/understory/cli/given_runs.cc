#include "understory/cli/given_runs.h"

#include <string>

#include "understory/pipeline/run_folder/run_version.h"

namespace understory {

void check_given_runs(const CLI::App& app, Log& log) {
  for (const CLI::Option* option : app.get_options()) {
    // A run that is resumed is not finished, and has its own check.
    if (option->check_lname("output") || option->check_lname("resume")) continue;
    for (const std::string& given : option->results())
      check_given_run(given, log);
  }
  for (const CLI::App* chosen : app.get_subcommands())
    check_given_runs(*chosen, log);
}

}  // namespace understory
