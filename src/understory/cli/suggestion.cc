#include "understory/cli/suggestion.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "understory/pipeline/run_folder/run_json.h"
#include "understory/pipeline/run_folder/work_folder.h"
#include "understory/recording/bags/ros2_bag.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"
#include "understory/util/shell_word.h"

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

// Something beside a name that is not there, which may have been meant. It has the same name with
// an ending (a recording first), or a letter or two otherwise. Empty if there is none.
std::string nearest_file(const fs::path& missing) {
  constexpr std::size_t kMistyped = 2;  // letters [chosen]
  const std::string meant = missing.filename().string();
  const fs::path folder = missing.has_parent_path() ? missing.parent_path() : fs::path(".");
  std::vector<std::string> endings;
  std::vector<std::string> mistyped;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (meant.size() > kMistyped && name.starts_with(meant + "."))
      endings.push_back(name);
    else if (meant.size() > 2 * kMistyped && letters_apart(meant, name) <= kMistyped)
      mistyped.push_back(name);
  }
  std::sort(endings.begin(), endings.end(), [](const std::string& a, const std::string& b) {
    return std::pair(!names_recording(a), a) < std::pair(!names_recording(b), b);
  });
  std::sort(mistyped.begin(), mistyped.end());
  endings.insert(endings.end(), mistyped.begin(), mistyped.end());
  return endings.empty() ? std::string() : (missing.parent_path() / endings.front()).string();
}

// A name of nothing. Simulated recordings have no file.
void refuse_missing(const std::string& given) {
  std::error_code error;
  if (given.empty() || given.starts_with("sim:") ||
      fs::status(given, error).type() != fs::file_type::not_found)
    return;
  const std::string meant = nearest_file(given);
  if (meant.empty()) return;  // its reader says that it is missing
  throw InputError(given, "", "no such file or folder; did you mean " + shell_word(meant) + "?");
}

// Of `simulate`, which wrote the recording beside it.
void refuse_truth(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::exists(folder / "site.yaml", ignored) || !fs::exists(folder / "trees.csv", ignored))
    return;
  std::string beside;
  for (const char* ending : {".mcap", ".pcap"}) {
    fs::path recording = folder.has_filename() ? folder : folder.parent_path();
    recording.replace_extension(ending);
    if (fs::is_regular_file(recording, ignored)) beside = recording.string();
  }
  throw InputError(folder.string(), "",
                   "holds the truth of a simulated recording, and no scans" +
                       (beside.empty() ? "" : ": the recording is " + shell_word(beside)));
}

}  // namespace

void refuse_run(const std::string& recording) {
  std::error_code ignored;
  refuse_missing(recording);
  if (!fs::is_directory(recording, ignored)) return;
  refuse_truth(recording);
  const bool unfinished = holds_unfinished_run(recording);
  if (!unfinished && !RunJson(recording).is_ours()) return;
  const fs::path cloud = fs::path(recording) / "map.laz";
  const bool has_cloud = fs::exists(cloud, ignored);
  std::string advice;
  if (has_cloud)
    advice = "`understory inventory " + shell_word(unfinished ? cloud.string() : recording) +
             " -o DIR` measures the trees of its map";
  else if (!unfinished)
    advice = "its results and the recording that it was made of stand in " +
             (fs::path(recording) / RunJson::kName).string();
  if (unfinished)
    advice +=
        (advice.empty() ? "" : ", ") + ("`" + resume_command(recording) + "` goes on with it");
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
  refuse_run(recording);
  if (fs::is_directory(recording, ignored)) {
    const std::string cloud = single_cloud(recording);
    if (cloud.empty()) return;
    throw InputError(recording, "",
                     "holds one point cloud, and a map is made of many: `understory inventory " +
                         shell_word(cloud) + " -o DIR` measures its trees");
  }
  if (!fs::is_regular_file(recording, ignored) || !has_map_name(recording)) return;
  throw InputError(
      recording, "",
      "is one point cloud, and a map is made of many: `understory inventory " +
          shell_word(recording) +
          " -o DIR` measures its trees, `understory map FOLDER` maps a folder of clouds");
}

void refuse_recording(const std::string& cloud) {
  std::error_code ignored;
  refuse_missing(cloud);
  const bool folder = fs::is_directory(cloud, ignored) && !fs::exists(fs::path(cloud) / "map.laz");
  if (!folder && !names_recording(cloud)) return;
  throw InputError(cloud, "",
                   folder
                       ? "expected a point cloud, or a run folder with a map.laz in it; a folder "
                         "of clouds or a bag is mapped first: `understory map " +
                             shell_word(cloud) + " -o RUN`"
                       : "is a recording, no point cloud: map it first with `understory map " +
                             shell_word(cloud) + " -o RUN`, then give RUN");
}

bool is_stems_name(const std::string& file) {
  return ends_with_one_of(file, {"stems.csv.gz", "stems.csv"});
}

void refuse_stems(const std::string& recording) {
  std::error_code ignored;
  if (!is_stems_name(recording) || !fs::is_regular_file(recording, ignored)) return;
  throw InputError(recording, "",
                   "holds the stems of a recording, no scans: `understory correct " +
                       shell_word(recording) + " -o DIR` maps them");
}

void refuse_folder(const std::string& cloud) {
  std::error_code ignored;
  refuse_missing(cloud);
  if (!fs::is_directory(cloud, ignored)) return;
  const fs::path map = fs::path(cloud) / "map.laz";
  throw InputError(cloud, "",
                   "is a folder: expected one cloud" +
                       (fs::exists(map, ignored) ? ", for instance " + map.string() : ""));
}

void refuse_lists_of_trees(const std::string& estimate, const std::string& truth) {
  for (const std::string& given : {estimate, truth}) {
    std::error_code ignored;
    const bool folder = fs::is_directory(given, ignored);
    const bool list = folder ? fs::exists(fs::path(given) / "trees.csv", ignored) &&
                                   !fs::exists(fs::path(given) / "trajectory.tum", ignored)
                             : fs::path(given).filename() == "trees.csv";
    if (!list) continue;
    throw InputError(given, "",
                     std::string(folder ? "holds" : "is") +
                         " a list of trees and no path: `understory evaluate trees " +
                         shell_word(estimate) + " " + shell_word(truth) + "` compares lists");
  }
}

void refuse_unmapped(const std::string& given, const std::string& options) {
  std::error_code ignored;
  refuse_missing(given);
  if (!names_recording(given) || fs::is_directory(given, ignored)) return;
  throw InputError(given, "",
                   "is a recording: map it first with `understory map " + shell_word(given) +
                       " -o RUN" + options + "`, then give RUN");
}

}  // namespace understory
