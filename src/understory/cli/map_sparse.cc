#include "understory/cli/map_sparse.h"

#include <cstdio>

#include "understory/pipeline/sparse_mapping.h"
#include "understory/util/error.h"

namespace understory {

int run_sparse_map(const SparseMapOptions& options, CommandContext& context) {
  SparseMappingRequest request;
  ConfigTable table = sparse_mapping_table(request.config);
  if (!options.config_file.empty()) table.read_file(options.config_file);
  table.set(options.settings);
  if (options.print_config) {
    std::fputs(table.to_yaml(true).c_str(), stdout);
    return kExitDone;
  }
  if (options.recording.empty() || options.run_folder.empty())
    throw ConfigError({"understory map --front-end sparse needs a RECORDING and -o RUN"});
  request.recording = options.recording;
  request.run_folder = options.run_folder;
  request.config_yaml = table.to_yaml(false);
  request.open = options.open;
  request.overwrite = options.overwrite;
  const CorrectionOutcome outcome =
      run_sparse_mapping(request, context.log, context.progress, context.stop_requested);
  std::printf("%s\n", outcome.summary.c_str());
  for (const std::string& reason : outcome.reasons)
    std::fprintf(stderr, "warning: result %s: %s\n", to_string(outcome.status).c_str(),
                 reason.c_str());
  return outcome.status == RunStatus::kComplete ? kExitDone : kExitUntrusted;
}

}  // namespace understory
