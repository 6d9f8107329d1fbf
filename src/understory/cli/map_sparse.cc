#include "understory/cli/map_sparse.h"

#include <cstdio>

#include "understory/cli/outcome.h"
#include "understory/pipeline/sparse_mapping.h"
#include "understory/util/error.h"

namespace understory {

int run_sparse_map(const SparseMapOptions& options, CommandContext& context) {
  SparseMappingRequest request;
  request.config = read_sparse_mapping_config(options.profile, options.config_file,
                                              options.settings, context.log);
  const ConfigTable table = sparse_mapping_table(request.config);
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
  request.realtime = options.realtime;
  request.overwrite = options.overwrite;
  return report_outcome(
      run_sparse_mapping(request, context.log, context.progress, context.stop_requested));
}

}  // namespace understory
