#include "understory/pipeline/run_folder.h"

#include <system_error>

#include "understory/util/error.h"

namespace understory {

namespace fs = std::filesystem;

fs::path checkpoint_of(const fs::path& run_folder) {
  return run_folder / "work" / "checkpoint.bin";
}

void refuse_unfinished_run(const fs::path& run_folder) {
  if (!fs::exists(checkpoint_of(run_folder))) return;
  throw OutputError(run_folder.string(),
                    "holds an unfinished run; go on with `understory map --resume " +
                        run_folder.string() + "` or give --overwrite to start anew");
}

void remove_old_results(const fs::path& run_folder) {
  for (const char* name :
       {"trajectory.tum", "odometry.tum", "keyframes.tum", "states.csv.gz", "graph.g2o", "gnss.csv",
        "steps.csv", "loops.csv", "corrections.csv", "map.laz", "trees.csv", "felled.csv",
        "cuts.csv", "trees.gpkg", "dtm.tif", "chm.tif", "run.json", "report.html"}) {
    std::error_code ignored;  // what cannot be removed cannot be replaced, which is then said
    fs::remove(run_folder / name, ignored);
  }
}

}  // namespace understory
