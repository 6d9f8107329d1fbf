#include "understory/pipeline/run_folder/run_results.h"

#include <algorithm>
#include <system_error>

#include "understory/pipeline/run_folder/run_json.h"

namespace understory {
namespace fs = std::filesystem;

const std::vector<std::string>& result_names() {
  static const std::vector<std::string> names = {"trajectory.tum",
                                                 "odometry.tum",
                                                 "keyframes.tum",
                                                 "states.csv.gz",
                                                 "stems.csv.gz",
                                                 "trajectory_imu.tum",
                                                 "trajectory_partial.tum",
                                                 "graph.g2o",
                                                 "gnss.csv",
                                                 "global.csv.gz",
                                                 "steps.csv",
                                                 "loops.csv",
                                                 "corrections.csv",
                                                 "map.laz",
                                                 "map.copc.laz",
                                                 "trees.csv",
                                                 "stem_curves.csv",
                                                 "dead_wood.csv",
                                                 "felled.csv",
                                                 "cuts.csv",
                                                 "trees.gpkg",
                                                 "dtm.tif",
                                                 "dsm.tif",
                                                 "chm.tif",
                                                 "obstacles.laz",
                                                 "free_height.tif",
                                                 "map.qgs",
                                                 "deformation.csv",
                                                 "plots.csv",
                                                 "plot_classes.csv",
                                                 "run.json",
                                                 "report.html"};
  return names;
}

bool is_result_name(const std::string& name) {
  return std::find(result_names().begin(), result_names().end(), name) != result_names().end();
}

FormerResults former_results(const fs::path& folder) {
  FormerResults former;
  // A link is somebody's own: what it leads to is not replaced.
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(folder / RunJson::kName, error))) return former;
  const RunJson json(folder);
  former.present = json.is_ours();
  if (!former.present) return former;
  former.names.insert(RunJson::kName);
  if (!json.has("/files")) {  // of a version that kept no list
    former.names.insert(result_names().begin(), result_names().end());
    return former;
  }
  for (const std::string& name : json.find_texts("/files")) {
    const fs::path path(name);
    if (path.has_filename() && path == path.filename()) former.names.insert(name);
  }
  return former;
}

std::string foreign_result(const fs::path& folder, const std::set<std::string>& own) {
  for (const std::string& name : result_names()) {
    std::error_code error;
    const fs::file_status status = fs::symlink_status(folder / name, error);
    if (!fs::exists(status)) continue;
    if (own.count(name) == 0 || !fs::is_regular_file(status)) return name;
  }
  return "";
}

}  // namespace understory
