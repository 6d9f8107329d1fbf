#include "understory/preprocess/streams/stream_offset.h"

#include <algorithm>
#include <cstdlib>

namespace understory {
namespace {

// Leads that are steady, of clocks that are far apart: enough where no more will come.
constexpr int kFew = 8;

}  // namespace

void StreamOffset::add(TimeNs lead, TimeNs reference, const Limits& limits) {
  if (verdict_ != Verdict::kOpen) return;
  if (lead <= limits.ahead && lead >= -limits.behind) {
    verdict_ = Verdict::kAgrees;
    return;
  }
  const bool steady =
      count_ > 0 && std::max(highest_, lead) - std::min(lowest_, lead) <= limits.spread;
  if (!steady) {
    count_ = 1;
    since_ = latest_ = reference;
    lowest_ = highest_ = lead;
    return;
  }
  ++count_;
  latest_ = reference;
  lowest_ = std::min(lowest_, lead);
  highest_ = std::max(highest_, lead);
  if (count_ >= limits.count && reference - since_ >= kLongEnough) verdict_ = Verdict::kConstant;
}

void StreamOffset::give_up() {
  if (verdict_ != Verdict::kOpen) return;
  const bool apart = std::min(std::abs(lowest_), std::abs(highest_)) > kLongEnough;
  const bool lasting = count_ >= kFew && latest_ - since_ >= kLongEnough / 2;
  verdict_ = lasting && apart ? Verdict::kConstant : Verdict::kAgrees;
}

}  // namespace understory
