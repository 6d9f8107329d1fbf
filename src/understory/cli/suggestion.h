#pragma once

#include <string>
#include <vector>

namespace understory {

// The word that is nearest to `given` by letters to change, add, leave out or swap. Empty if none
// is near enough to have been meant.
[[nodiscard]] std::string nearest_word(const std::string& given,
                                       const std::vector<std::string>& words);

// All of these also end with an error that proposes a name where nothing has the given one, and
// something beside it nearly has.

// Error if `recording` is one point cloud, a folder with one, or the folder of a run, finished or
// not. They make no map: the error names the command that takes them.
void refuse_cloud(const std::string& recording);
// Error if `recording` is the folder of a run, finished or not: its map would be taken for a scan.
// Also if it is the truth that `simulate` leaves beside a recording.
void refuse_run(const std::string& recording);
// Whether a file is called as stems are: stems.csv.gz or stems.csv, also with words before.
[[nodiscard]] bool is_stems_name(const std::string& file);
// Error if `recording` is a file of stems, by its name: `correct` takes it.
void refuse_stems(const std::string& recording);
// Error if `cloud` is a folder, where one file is expected. The map of a run is proposed.
void refuse_folder(const std::string& cloud);
// Error if `cloud` is a recording, which has to be mapped first.
void refuse_recording(const std::string& cloud);
// The same where a run or one of its files is expected. `options` are those of `map` that make what
// is needed.
void refuse_unmapped(const std::string& given, const std::string& options = "");
// Error if one of the two holds a list of trees and no path, where paths are compared: `evaluate
// trees` compares lists.
void refuse_lists_of_trees(const std::string& estimate, const std::string& truth);

}  // namespace understory
