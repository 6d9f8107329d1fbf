#pragma once

#include <oneapi/tbb/task_arena.h>

#include <cstddef>

#include "understory/util/parallel.h"

namespace understory {

// parallel_for for few large pieces of work with parallel loops inside. A thread that waits for
// such a loop takes up no further piece, so that as many are at work as there are threads.
template <typename Body>
void parallel_pieces(std::size_t n, const Body& body) {
  parallel_for(n, 1,
               [&](std::size_t i) { oneapi::tbb::this_task_arena::isolate([&] { body(i); }); });
}

// Threads that parallel loops called from here may use.
[[nodiscard]] inline int available_threads() {
  return oneapi::tbb::this_task_arena::max_concurrency();
}

}  // namespace understory
