#include <cstdio>
#include <memory>

#include "understory/cli/command.h"
#include "understory/cli/outcome.h"
#include "understory/pipeline/mapping/mapping.h"

namespace understory {
namespace {

struct DemoOptions {
  std::string folder = "demo";
  bool overwrite = false;
};

int run_demo(const DemoOptions& options, CommandContext& context) {
  context.log.info(
      "mapping a simulated stand of 40 x 40 m, scanned by a walker with a handheld "
      "128-channel lidar");
  MappingRequest request;
  request.recording = "sim:demo";
  request.run_folder = options.folder;
  ReadConfig<FrontEndConfig> read =
      read_front_end_config(kDenseFrontEnd, "handheld", "", {}, context.log);
  request.config = std::move(read.config);
  request.config_record.origins = std::move(read.origins);
  request.config_record.asked_yaml = yaml_of(request.config);
  request.overwrite = options.overwrite;
  return report_outcome(run_mapping(begin_mapping(std::move(request)), context.log,
                                    context.progress, context.stop_requested));
}

}  // namespace

void add_demo_command(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("demo", "Simulate a small stand, map it, show the report");
  const auto options = std::make_shared<DemoOptions>();
  command->add_option("-o,--output", options->folder, "Run folder to write")->capture_default_str();
  command->add_flag("--overwrite", options->overwrite, kOverwriteMeaning);
  command->footer("Example:\n  understory demo -o /tmp/demo");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) { return run_demo(*options, context); };
  });
}

}  // namespace understory
