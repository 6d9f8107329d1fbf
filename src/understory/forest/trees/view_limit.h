#pragma once

#include <vector>

namespace understory {

// A tree, and how far it stands from where the scanner was.
struct TreeInView {
  double height_m = 0.0;
  double dbh_m = 0.0;
  double farness = 0.0;  // larger: farther; of any unit
};

// Which heights may be those of the scanner's view. A scanner that cannot look up sees the trees
// beside it only up to a height, and those far away higher up. So the trees are put in order of
// their distance. Of 20 trees the third highest is compared with the next ones, of which the
// thinnest 40 % of the stand do not count. The view ended there where 60 % of any 40 farther ones
// are higher: by chance it is 14 %. The search goes outwards, and ends where under 40 % of them
// are. Trees over 45 % of the height that was seen there may go on.
// For each tree 1 or 0, in their order; all 0 where they are fewer than 60 thick ones. Trees with
// an unknown height or diameter count for nothing.
[[nodiscard]] std::vector<char> ends_with_the_view(const std::vector<TreeInView>& trees);

}  // namespace understory
