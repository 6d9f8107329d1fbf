#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// What shows that the scans of a cloud do not lie on each other. Trees stand twice in it, or stems
// are longer in one direction than across. Metres.
struct DoubleImages {
  std::vector<char> twice;  // of each stem: another one of the list is the same tree
  std::size_t trees = 0;    // how many stems of the list that is
  double apart_m = 0.0;     // median distance of the two images; 0 where no tree stands twice
  // Of each stem: how far two scans lie apart by the outlines of the stems around and its own.
  std::vector<double> oval_m;  // 0 where nothing shows it
  std::size_t round = 0;       // stems that were seen all round
  std::size_t oval = 0;        // of how many of them oval_m is over 0
  double oval_apart_m = 0.0;   // median over these
};

// Two stems up to 0.6 m apart and of like diameter are a pair. They are images of one tree where
// most pairs nearby lie apart by the same vector. Forks lie in all directions. Where a third stem
// goes on in the same line, they stand in a row. An outline tells of two scans where the stems
// around are as long in the same direction, and longer than trees grow. `stems` in one frame.
// A cloud that was laid on itself up to 3 m off is told by one offset that most stems share, with
// diameters that agree. Deterministic.
[[nodiscard]] DoubleImages find_double_images(const std::vector<StemFit>& stems);

// Why a list of trees is not to be trusted, in words for a forester; empty: nothing says so.
[[nodiscard]] std::string complaint_of(const DoubleImages& images);

}  // namespace understory
