#pragma once

#include "understory/util/time.h"

namespace understory {

// A tree of a tree list that stood at first and was gone later: a row of felled.csv.
struct TreeFall {
  int tree_id = 0;  // as in the tree list, which goes on listing it
  double x = 0.0;   // where it stood, world frame, metres
  double y = 0.0;
  TimeNs seen_until = 0;  // it fell between these
  TimeNs gone_since = 0;
  int missed = 0;  // views that should have seen it from then on
};

}  // namespace understory
