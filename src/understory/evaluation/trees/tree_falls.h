#pragma once

#include <filesystem>
#include <vector>

#include "understory/evaluation/trees/tree_merge.h"
#include "understory/forest/trees/tree_fall.h"

namespace understory {

// Reads felled.csv (docs/reference/outputs.md). Throws InputError with the line where a cell is no
// number or a time is missing.
[[nodiscard]] std::vector<TreeFall> read_tree_falls(const std::filesystem::path& path);

// The same falls where `trees` has their trees by now; those of trees that it does not list are
// left out.
[[nodiscard]] std::vector<TreeFall> placed(const std::vector<TreeFall>& falls,
                                           const std::vector<Tree>& trees);

// Falls of two tree lists that were merged, of trees by their new numbers. A tree that fell in both
// fell while both say so, if there is such a time, else when S says.
[[nodiscard]] std::vector<TreeFall> merged_falls(const MergedTrees& merged,
                                                 const std::vector<Tree>& s,
                                                 const std::vector<TreeFall>& falls_of_s,
                                                 const std::vector<Tree>& l,
                                                 const std::vector<TreeFall>& falls_of_l);

}  // namespace understory
