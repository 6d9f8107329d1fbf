#include "understory/cli/map_sparse.h"

#include <cstdio>

#include "understory/cli/open_options.h"
#include "understory/cli/outcome.h"
#include "understory/pipeline/mapping/adaptation.h"
#include "understory/pipeline/mapping/sparse_mapping.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"

namespace understory {

namespace {

int print_config(const SparseMapOptions& options, const ReadConfig<SparseMappingConfig>& read,
                 CommandContext& context) {
  if (!options.recording.empty()) {
    SensorTraits traits;
    static_cast<void>(
        learn_traits(open_source(options.recording, options.open, context.log), traits));
    std::fputs(("# " + to_string(traits) + "\n").c_str(), stdout);
  }
  RunConditions conditions;
  conditions.realtime = options.realtime;
  const Adapted<SparseMappingConfig> adapted = adapt(read.config, read.origins, conditions);
  std::fputs(commented_yaml(adapted, read.origins).c_str(), stdout);
  return kExitDone;
}

}  // namespace

int run_sparse_map(const SparseMapOptions& options, CommandContext& context) {
  SparseMappingRequest request;
  ReadConfig<SparseMappingConfig> read = read_sparse_mapping_config(
      options.profile, options.config_file, options.settings, context.log);
  if (options.print_config) return print_config(options, read, context);
  request.config = std::move(read.config);
  request.config_origins = std::move(read.origins);
  if (options.recording.empty() || options.run_folder.empty())
    throw ConfigError({"understory map --front-end sparse needs a RECORDING and -o RUN"});
  request.recording = options.recording;
  request.run_folder = options.run_folder;
  refuse_run_over_inputs(request.run_folder, request.recording, options.open,
                         {options.config_file, request.config.machine_boxes_file,
                          request.config.correction.harvester.head_log});
  request.config_yaml = sparse_mapping_table(request.config).to_yaml(false);
  request.open = options.open;
  request.realtime = options.realtime;
  request.overwrite = options.overwrite;
  return report_outcome(
      run_sparse_mapping(request, context.log, context.progress, context.stop_requested));
}

}  // namespace understory
