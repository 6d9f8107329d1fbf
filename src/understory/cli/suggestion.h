#pragma once

#include <string>
#include <vector>

namespace understory {

// The word that is nearest to `given` by letters to change, add, leave out or swap; empty if none
// is near enough to have been meant.
[[nodiscard]] std::string nearest_word(const std::string& given,
                                       const std::vector<std::string>& words);

// Error if `recording` is one point cloud, which makes no map: it names the command that takes it.
void refuse_cloud(const std::string& recording);
// Error if `cloud` is a recording, which has to be mapped first.
void refuse_recording(const std::string& cloud);

}  // namespace understory
