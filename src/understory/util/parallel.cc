#include "understory/util/parallel.h"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>

namespace understory {

int hardware_threads() {
  return oneapi::tbb::info::default_concurrency();
}

void with_threads(int threads, const std::function<void()>& work) {
  const int count = threads > 0 ? threads : hardware_threads();
  const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism,
                                          static_cast<std::size_t>(std::max(count, 1)));
  oneapi::tbb::task_arena arena(count);
  arena.execute(work);
}

void in_arena(int threads, const std::function<void()>& work) {
  oneapi::tbb::task_arena arena(threads);
  arena.execute(work);
}

}  // namespace understory
