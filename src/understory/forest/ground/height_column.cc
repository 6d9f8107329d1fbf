#include "understory/forest/ground/height_column.h"

#include <cmath>

#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::height_column;

}  // namespace

double HeightColumn::most(int begin, int end) const {
  double most = 0.0;
  for (int metre = begin; metre < std::min(end, kMetres); ++metre)
    most = std::max(most, at(metre));
  return most;
}

int HeightColumn::connected_end(int first, int largest_gap) const {
  const double least = std::max(1.0, kLeastShare * most(first, kMetres));
  int last = first - 1;
  for (int metre = first; metre < kMetres && metre - last <= largest_gap; ++metre) {
    if (at(metre) >= least) last = metre;
  }
  return last + 1;
}

// The highest metre after which the points drop clearly, else the one after which they drop most.
int HeightColumn::clearest_drop(int first, int end) const {
  int clearest = first;
  double largest = 0.0;
  const double least = kLeastShare * most(first, kMetres);
  for (int metre = end - 1; metre >= first; --metre) {
    if (at(metre) < least) continue;
    // The next metre may hold the end of the tip.
    const double drop = at(metre) / (1.0 + most(metre + 2, metre + 2 + kSky));
    if (drop >= kDrop) return metre;
    if (drop <= largest) continue;
    largest = drop;
    clearest = metre;
  }
  return clearest;
}

// Where a tip begins that holds less than a crown, as few beams came there. It hangs together with
// the metre `top` without any gap, and ends as suddenly. Ghosts do not: they thin out.
int HeightColumn::thin_tip(int top) const {
  int last = top;
  while (last + 1 < kMetres && at(last + 1) > 0.0)
    ++last;
  for (int metre = last; metre > top; --metre) {
    if (at(metre) >= kLeastTip && at(metre) >= kDrop * (1.0 + most(metre + 2, metre + 2 + kSky)))
      return metre;
  }
  return top;
}

int HeightColumn::top(int first, int end) const {
  const int clear = clearest_drop(first, end);
  int top = thin_tip(clear);
  if (top > clear) end = kMetres;
  for (; top + 1 < end; ++top) {
    const double ghosts = most(top + 3, top + 3 + kSky);
    if (at(top + 1) <= ghosts + kSigmas * std::sqrt(ghosts)) break;
  }
  return top;
}

}  // namespace understory
