#include <cstdio>
#include <memory>

#include "understory/cli/command.h"
#include "understory/cli/outcome.h"
#include "understory/pipeline/mapping.h"

namespace understory {
namespace {

int run_demo(const std::string& folder, CommandContext& context) {
  context.log.info(
      "mapping a simulated stand of 40 x 40 m, scanned by a walker with a handheld "
      "128-channel lidar");
  MappingRequest request;
  request.recording = "sim:demo";
  request.run_folder = folder;
  ReadConfig<MappingConfig> read = read_mapping_config("handheld", "", {});
  request.config = std::move(read.config);
  request.config_origins = std::move(read.origins);
  request.config_yaml = mapping_table(request.config).to_yaml(false);
  request.overwrite = true;
  return report_outcome(
      run_mapping(request, context.log, context.progress, context.stop_requested));
}

}  // namespace

void add_demo_command(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("demo", "Simulate a small stand, map it, show the report");
  const auto folder = std::make_shared<std::string>("demo");
  command->add_option("-o,--output", *folder, "Run folder to write")->capture_default_str();
  command->footer("Example:\n  understory demo -o /tmp/demo");
  command->callback([&chosen, folder] {
    chosen = [folder](CommandContext& context) { return run_demo(*folder, context); };
  });
}

}  // namespace understory
