#include "understory/cli/suggestion.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "understory/pipeline/run_folder/run_json.h"
#include "understory/pipeline/run_folder/work_folder.h"
#include "understory/recording/bags/ros2_bag.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// Optimal string alignment distance.
std::size_t letters_apart(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j)
    d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, changed});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

bool ends_with_one_of(const std::string& name, const std::vector<std::string>& endings) {
  std::string small = name;
  std::transform(small.begin(), small.end(), small.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  return std::any_of(endings.begin(), endings.end(),
                     [&](const std::string& ending) { return small.ends_with(ending); });
}

bool names_recording(const std::string& given) {
  return given.starts_with("sim:") ||
         ends_with_one_of(given, {".mcap", ".bag", ".db3", ".pcap", ".pcapng"});
}

// The one cloud of a folder that holds no other scans; empty if there is none, or are several.
std::string single_cloud(const std::string& folder) {
  if (is_ros2_bag_folder(folder)) return {};
  std::string found;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    const std::string path = entry->path().string();
    if (!entry->is_regular_file(ignored)) continue;
    const bool cloud = has_map_name(path);
    if (ends_with_one_of(path, {".bin"}) || (cloud && !found.empty())) return {};
    if (cloud) found = path;
  }
  return found;
}

}  // namespace

void refuse_run(const std::string& recording) {
  std::error_code ignored;
  if (!fs::is_directory(recording, ignored)) return;
  const bool unfinished = holds_unfinished_run(recording);
  if (!unfinished && !RunJson(recording).is_ours()) return;
  const fs::path cloud = fs::path(recording) / "map.laz";
  const bool has_cloud = fs::exists(cloud, ignored);
  std::string advice;
  if (has_cloud)
    advice = "`understory inventory " + (unfinished ? cloud.string() : recording) +
             " -o DIR` measures the trees of its map";
  else if (!unfinished)
    advice = "its results and the recording that it was made of stand in " +
             (fs::path(recording) / RunJson::kName).string();
  if (unfinished)
    advice += (advice.empty() ? "" : ", ") +
              ("`understory map --resume " + recording + "` goes on with it");
  throw InputError(recording, "", "is the folder of a run, no recording: " + advice);
}

std::string nearest_word(const std::string& given, const std::vector<std::string>& words) {
  std::string best;
  // Half of the letters may be wrong. The dashes of an option are no letters.
  std::size_t least = (given.size() - std::min(given.size(), given.find_first_not_of('-'))) / 2 + 1;
  for (const std::string& word : words) {
    const bool begun = given.size() >= 2 && word.starts_with(given);
    const std::size_t apart = begun ? 1 : letters_apart(given, word);
    if (apart >= least) continue;
    least = apart;
    best = word;
  }
  return best;
}

void refuse_cloud(const std::string& recording) {
  std::error_code ignored;
  if (fs::is_directory(recording, ignored)) {
    refuse_run(recording);
    const std::string cloud = single_cloud(recording);
    if (cloud.empty()) return;
    throw InputError(recording, "",
                     "holds one point cloud, and a map is made of many: `understory inventory " +
                         cloud + " -o DIR` measures its trees");
  }
  if (!fs::is_regular_file(recording, ignored) || !has_map_name(recording)) return;
  throw InputError(
      recording, "",
      "is one point cloud, and a map is made of many: `understory inventory " + recording +
          " -o DIR` measures its trees, `understory map FOLDER` maps a folder of clouds");
}

void refuse_recording(const std::string& cloud) {
  std::error_code ignored;
  const bool folder = fs::is_directory(cloud, ignored) && !fs::exists(fs::path(cloud) / "map.laz");
  if (!folder && !names_recording(cloud)) return;
  throw InputError(cloud, "",
                   folder
                       ? "expected a point cloud, or a run folder with a map.laz in it; a folder "
                         "of clouds or a bag is mapped first: `understory map " +
                             cloud + " -o RUN`"
                       : "is a recording, no point cloud: map it first with `understory map " +
                             cloud + " -o RUN`, then give RUN");
}

void refuse_stems(const std::string& recording) {
  std::error_code ignored;
  if (!ends_with_one_of(recording, {"stems.csv.gz", "stems.csv"}) ||
      !fs::is_regular_file(recording, ignored))
    return;
  throw InputError(recording, "",
                   "holds the stems of a recording, no scans: `understory correct " + recording +
                       " -o DIR` maps them");
}

void refuse_folder(const std::string& cloud) {
  std::error_code ignored;
  if (!fs::is_directory(cloud, ignored)) return;
  const fs::path map = fs::path(cloud) / "map.laz";
  throw InputError(cloud, "",
                   "is a folder: expected one cloud" +
                       (fs::exists(map, ignored) ? ", for instance " + map.string() : ""));
}

void refuse_unmapped(const std::string& given, const std::string& options) {
  std::error_code ignored;
  if (!names_recording(given) || fs::is_directory(given, ignored)) return;
  throw InputError(given, "",
                   "is a recording: map it first with `understory map " + given + " -o RUN" +
                       options + "`, then give RUN");
}

}  // namespace understory
