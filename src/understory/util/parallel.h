#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <cstddef>
#include <functional>
#include <vector>

namespace understory {

// Runs `body(i)` for all i in [0, n) on the current arena, `grain` indices at a time. The body must
// write only to what belongs to index i.
template <typename Body>
void parallel_for(std::size_t n, std::size_t grain, const Body& body) {
  if (n <= grain) {
    for (std::size_t i = 0; i < n; ++i)
      body(i);
    return;
  }
  oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, n, grain),
                            [&](const oneapi::tbb::blocked_range<std::size_t>& range) {
                              for (std::size_t i = range.begin(); i != range.end(); ++i)
                                body(i);
                            });
}

// Sum over [0, n) that gives the same bits for any number of threads. The indices are cut into
// blocks of fixed size, and `accumulate(sum, i)` runs in order within a block. The blocks' sums are
// added in order of the blocks. `Sum` needs operator+=.
template <typename Sum, typename Accumulate>
[[nodiscard]] Sum ordered_sum(std::size_t n, std::size_t block, const Sum& zero,
                              const Accumulate& accumulate) {
  const std::size_t blocks = (n + block - 1) / block;
  std::vector<Sum> sums(blocks, zero);
  parallel_for(blocks, 1, [&](std::size_t b) {
    const std::size_t end = b * block + block < n ? b * block + block : n;
    for (std::size_t i = b * block; i < end; ++i)
      accumulate(sums[b], i);
  });
  Sum total = zero;
  for (const Sum& sum : sums)
    total += sum;
  return total;
}

// Runs `work` in a task arena of exactly `threads` threads (at least 1; 0 = all of the machine). No
// parallel call inside uses more than that.
void with_threads(int threads, const std::function<void()>& work);

// Runs `work` in an arena of its own of `threads` threads, within the limit of the process: for
// work beside the main loop.
void in_arena(int threads, const std::function<void()>& work);

// Number of threads that the machine offers.
[[nodiscard]] int hardware_threads();

}  // namespace understory
