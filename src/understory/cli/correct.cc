#include <cstdio>
#include <memory>

#include "understory/cli/command.h"
#include "understory/cli/outcome.h"
#include "understory/cli/suggestion.h"
#include "understory/pipeline/correction/correction.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"

namespace understory {
namespace {

struct CorrectOptions {
  std::string stems;
  std::string run_folder;
  std::string config_file;
  std::vector<std::string> settings;
  bool overwrite = false;
  bool print_config = false;
};

int run_correct(const CorrectOptions& options, CommandContext& context) {
  CorrectionRequest request;
  ConfigTable table;
  table.section("odometry", [&] { describe(table, request.odometry); });
  describe(table, request.config);
  request.config_record.origins = read_settings(table, options.config_file, options.settings);
  if (options.print_config) {
    std::fputs(table.to_yaml(true).c_str(), stdout);
    return kExitDone;
  }
  if (options.stems.empty() || options.run_folder.empty())
    throw ConfigError({"understory correct needs STEMS.csv.gz or a run, and -o RUN"});
  refuse_unmapped(options.stems, " --front-end sparse");
  refuse_input_as_output(options.run_folder, {options.config_file});
  request.stems = options.stems;
  request.run_folder = options.run_folder;
  request.overwrite = options.overwrite;
  request.config_record.asked_yaml = table.to_yaml(false);
  return report_outcome(
      run_correction(request, context.log, context.progress, context.stop_requested));
}

}  // namespace

void add_correct_command(CLI::App& app, Command& chosen) {
  auto* command =
      app.add_subcommand("correct", "Trajectory and tree map from the stems of a recording alone");
  const auto options = std::make_shared<CorrectOptions>();
  command->add_option("STEMS", options->stems,
                      "Stems of the views (stems.csv.gz), or a run folder that holds them: its "
                      "trajectory is then where the correction begins");
  command->add_option("-o,--output", options->run_folder, "Run folder to write");
  command->add_option("--config", options->config_file, "YAML file of settings");
  add_settings_option(*command, options->settings);
  command->add_flag("--overwrite", options->overwrite, kOverwriteMeaning);
  command->add_flag("--print-config", options->print_config,
                    "Print every setting with default, unit, range and meaning");
  command->footer(
      "Examples:\n  understory correct stems.csv.gz -o forest\n"
      "  understory correct forest -o sharper --set correction.method=pose_graph");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) { return run_correct(*options, context); };
  });
}

}  // namespace understory
